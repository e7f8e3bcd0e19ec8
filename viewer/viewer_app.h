#pragma once

#include "viewer/frame_path.h"
#include "viewer/glfw_window.h"
#include "viewer/gui.h"
#include "viewer/precompute_task.h"
#include "viewer/session.h"

#include <array>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace afterglow {

struct ViewerOptions {
    /// A transfer file, or an OBJ file, which is precomputed first; where its scene is now.
    std::string file, scene;
    std::string frames;      // a path to be played at once
    IndirectMethod method = IndirectMethod::automatic;
    ViewLayer layer = ViewLayer::full;
    int width = 1280, height = 720;
    float exposure = 0.18f;
    std::string folder = "."; // of pictures, recorded paths and transfer files
    int threads = 0;          // of a precomputation, 0: all processors
};

/// Whether a file is a scene, not a transfer file.
bool is_scene(const std::string& path);

/// The window: a scene to walk through, a light to hold. docs/viewer.md says what a person can do.
class ViewerApp {
public:
    /// Opens the window and the file. Throws Error, FileError.
    explicit ViewerApp(const ViewerOptions& options);

    /// Until the window is closed. Throws Error where OpenGL failed.
    void run();

private:
    enum class Drag { none, orbit, look, pan, move_light, aim_light };

    ViewerOptions options_;
    GlfwWindow window_;
    Gui gui_;
    std::unique_ptr<Session> session_;
    std::unique_ptr<PrecomputeTask> precompute_;

    // What is shown.
    ViewLayer layer_;
    Overlay overlay_ = Overlay::none;
    int overlay_level_ = 0;
    bool tone_mapped_ = true, panels_ = true;
    float exposure_;
    std::optional<ToneMap> tone_map_;
    std::string message_; // the last thing to tell
    bool picture_is_old_ = true;
    std::optional<Camera> drawn_; // the camera of the last picture
    std::size_t most_new_ = 2000; // patches a picture, so that it takes about most_patch_seconds
    bool picture_wanted_ = false, screenshot_wanted_ = false; // to be written when they are drawn

    // What the person does.
    Drag drag_ = Drag::none;
    Vec2 pointer_ = Vec2::Zero(); // pixels
    Vec3 pivot_ = Vec3::Zero();
    double last_time_ = 0.0;

    // Paths.
    std::optional<double> recording_since_, playing_since_;
    std::vector<Frame> path_;

    // Timings of the last pictures [ms].
    struct Times {
        FrameTimings frame;
        MovingLightStatistics light;
    };
    Times times_;
    std::vector<float> frame_history_, light_history_;

    void open(const std::string& path);
    template <class Work>
    void attempt(const Work& work); // what fails is told in the window, which stays
    void set_light(const Spotlight& light);
    void connect_events();
    void on_key(int key);
    void on_button(int button, bool pressed, bool shift, bool control);
    void on_pointer(const Vec2& to);
    void on_wheel(float steps, bool shift, bool control);
    void fly_with_keys(double seconds);
    void play();
    void record();
    std::optional<SurfacePoint> surface_under(const Vec2& pixel);
    bool grabs_light(const Vec2& pixel) const;

    void step();
    void draw_picture();
    void draw_window();
    void draw_waiting(); // for the first file to be precomputed
    void write_picture();
    void write_screenshot(const std::string& name);
    void toggle_recording();

    void draw_panels();
    void draw_view_panel();
    void draw_light_panel();
    void draw_times_panel();
    void draw_file_panel();
    void draw_precompute_panel();
    /// A name in the folder that no file has with one of these endings: STEM, with a number where need be, or always.
    std::string free_name(const std::string& stem, std::initializer_list<const char*> endings,
                          bool always_numbered = true) const;
};

} // namespace afterglow

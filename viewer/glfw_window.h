#pragma once

#include "viewer/gl_context.h"

#include <functional>
#include <optional>
#include <string>
#include <vector>

struct GLFWwindow;

namespace afterglow {

/// What a person did with mouse and keyboard; places in pixels from the window's top left.
struct WindowEvents {
    std::function<void(int key, bool shift, bool control)> key; // pressed; GLFW's number
    std::function<void(int button, bool pressed, bool shift, bool control)> button;
    std::function<void(double x, double y)> pointer;
    std::function<void(double steps, bool shift, bool control)> wheel;
    std::function<void(std::string path)> drop;
};

/// A window with an OpenGL context.
class GlfwWindow : public GlContext {
public:
    /// Throws Error where there is no screen or no OpenGL 3.3.
    GlfwWindow(int width, int height, const std::string& title);
    ~GlfwWindow() override;

    const Gl& gl() const override { return *gl_; }
    GLFWwindow* handle() const { return window_; }
    WindowEvents events;

    /// Handles what has happened; waits for it, at most so long [s].
    void handle_events(double wait);
    bool should_close() const;
    void close();
    /// Pixels; zero while the window is minimised.
    int width() const;
    int height() const;
    bool is_down(int key) const;
    void set_title(const std::string& title);
    void swap();

private:
    GLFWwindow* window_ = nullptr;
    std::optional<Gl> gl_;
};

} // namespace afterglow

#include "viewer/viewer_app.h"

#include "core/error.h"
#include "core/progress.h"
#include "core/seconds.h"
#include "viewer/camera_control.h"
#include "viewer/light_control.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

namespace afterglow {
namespace {

constexpr double most_patch_seconds = 0.03; // of a picture, so that it stays smooth
constexpr std::size_t fewest_new = 200, most_at_once = 1'000'000;
constexpr std::size_t history = 200;
constexpr float grab_radius = 14.0f; // pixels about the light's mark

void remember(std::vector<float>& values, double seconds) {
    values.push_back(static_cast<float>(1e3 * seconds));
    if (values.size() > history) values.erase(values.begin());
}

} // namespace

bool is_scene(const std::string& path) { return path.ends_with(".obj") || path.ends_with(".OBJ"); }

ViewerApp::ViewerApp(const ViewerOptions& options)
    : options_(options), window_(options.width, options.height, "Afterglow"), gui_(window_),
      layer_(options.layer), exposure_(options.exposure) {
    if (!options.frames.empty()) path_ = read_frame_path(options.frames);
    connect_events();
    open(options.file);
    if (!session_ && !precompute_) throw Error(message_);
}

template <class Work>
void ViewerApp::attempt(const Work& work) {
    try {
        work();
    } catch (const std::exception& error) {
        message_ = error.what();
    }
}

void ViewerApp::open(const std::string& path) {
    if (is_scene(path)) {
        const std::string name = free_name(std::filesystem::path(path).stem().string(), {".afterglow"}, false);
        precompute_ = std::make_unique<PrecomputeTask>(path, name + ".afterglow", options_.threads);
        return;
    }
    attempt([&] { // the window stays with what it has
        auto opened = std::make_unique<Session>(window_.gl(), path, session_ ? "" : options_.scene,
                                                session_ ? session_->renderer.method() : options_.method);
        if (!session_ && !path_.empty()) playing_since_ = clock_seconds();
        session_ = std::move(opened);
        message_ = "opened " + path;
        window_.set_title("Afterglow - " + std::filesystem::path(path).filename().string());
        overlay_level_ = 0;
        picture_is_old_ = true;
    });
}

void ViewerApp::set_light(const Spotlight& light) {
    session_->light = light;
    session_->light_thread.set(light);
}

void ViewerApp::connect_events() {
    window_.events.key = [this](int key, bool, bool) {
        if (ImGui::GetIO().WantTextInput) return;
        if (key != GLFW_KEY_ESCAPE) {
            if (session_) on_key(key);
        } else if (!ImGui::IsPopupOpen(nullptr, ImGuiPopupFlags_AnyPopup)) {
            window_.close();
        }
    };
    window_.events.button = [this](int button, bool pressed, bool shift, bool control) {
        if (session_ && (!pressed || !ImGui::GetIO().WantCaptureMouse)) on_button(button, pressed, shift, control);
    };
    window_.events.pointer = [this](double x, double y) {
        if (session_) on_pointer(Vec2(static_cast<float>(x), static_cast<float>(y)));
    };
    window_.events.wheel = [this](double steps, bool shift, bool control) {
        if (session_ && !ImGui::GetIO().WantCaptureMouse) on_wheel(static_cast<float>(steps), shift, control);
    };
    window_.events.drop = [this](const std::string& path) {
        attempt([&] { open(path); });
    };
}

void ViewerApp::on_key(int key) {
    if (key >= GLFW_KEY_1 && key < GLFW_KEY_1 + view_layers) {
        layer_ = static_cast<ViewLayer>(key - GLFW_KEY_1);
        picture_is_old_ = true;
    }
    const int levels = session_->scene.file.transfer.points.levels();
    switch (key) {
    case GLFW_KEY_L: {
        Spotlight light = session_->light;
        put_at_camera(light, session_->camera);
        set_light(light);
        break;
    }
    case GLFW_KEY_C:
        message_ = command_line(session_->camera, session_->light);
        std::printf("%s\n", message_.c_str());
        std::fflush(stdout);
        break;
    case GLFW_KEY_P: picture_wanted_ = true; break;
    case GLFW_KEY_R: attempt([&] { toggle_recording(); }); break;
    case GLFW_KEY_SPACE:
        if (playing_since_)
            playing_since_.reset();
        else if (!path_.empty() && !recording_since_)
            playing_since_ = clock_seconds();
        break;
    case GLFW_KEY_O: overlay_ = static_cast<Overlay>((static_cast<int>(overlay_) + 1) % 4); break;
    case GLFW_KEY_UP: overlay_level_ = std::min(overlay_level_ + 1, levels - 1); break;
    case GLFW_KEY_DOWN: overlay_level_ = std::max(overlay_level_ - 1, 0); break;
    case GLFW_KEY_T:
        tone_mapped_ = !tone_mapped_;
        picture_is_old_ = true;
        break;
    case GLFW_KEY_TAB: panels_ = !panels_; break;
    case GLFW_KEY_F12: screenshot_wanted_ = true; break;
    default: break;
    }
}

std::optional<SurfacePoint> ViewerApp::surface_under(const Vec2& pixel) {
    const Hit hit = session_->scene.surface.closest_hit(
        {session_->camera.position, session_->camera.direction(pixel.x(), pixel.y())});
    if (!hit) return {};
    return session_->scene.surface.point(hit);
}

bool ViewerApp::grabs_light(const Vec2& pixel) const {
    if (!panels_) return false; // nor is its mark drawn
    const std::optional<Vec2> mark = project(session_->camera, session_->light.position);
    return mark && (*mark - pixel).norm() < grab_radius;
}

void ViewerApp::on_button(int button, bool pressed, bool shift, bool control) {
    if (!pressed) {
        drag_ = Drag::none;
        return;
    }
    const std::optional<SurfacePoint> under = surface_under(pointer_);
    pivot_ = under ? under->position : session_->camera.target;
    if (button == GLFW_MOUSE_BUTTON_LEFT && overlay_ == Overlay::links && !shift && !control && under)
        session_->overlays.pick(overlay_level_, *under);
    if (button == GLFW_MOUSE_BUTTON_LEFT)
        drag_ = control ? Drag::aim_light : shift || grabs_light(pointer_) ? Drag::move_light : Drag::orbit;
    else if (button == GLFW_MOUSE_BUTTON_RIGHT)
        drag_ = shift ? Drag::aim_light : Drag::look;
    else
        drag_ = Drag::pan;
    if (drag_ == Drag::aim_light) on_pointer(pointer_);
}

void ViewerApp::on_pointer(const Vec2& to) {
    Camera& camera = session_->camera;
    const Vec2 shift = (to - pointer_) / static_cast<float>(std::max(1, camera.height));
    pointer_ = to;
    Spotlight light = session_->light;
    switch (drag_) {
    case Drag::none: return;
    case Drag::orbit: orbit(camera, pivot_, -4.0f * shift.x(), 4.0f * shift.y()); break;
    case Drag::look: look(camera, 2.0f * shift.x(), -2.0f * shift.y()); break;
    case Drag::pan: pan(camera, shift.x(), -shift.y()); break;
    case Drag::move_light:
        move_along_view(light, camera, shift.x(), -shift.y());
        set_light(light);
        return;
    case Drag::aim_light:
        if (const std::optional<SurfacePoint> at = surface_under(to)) {
            aim(light, at->position);
            set_light(light);
        }
        return;
    }
}

void ViewerApp::on_wheel(float steps, bool shift, bool control) {
    Spotlight light = session_->light;
    if (shift) {
        widen(light, std::pow(1.1f, steps));
        set_light(light);
    } else if (control) {
        light.intensity *= std::pow(1.1f, steps);
        set_light(light);
    } else {
        const std::optional<SurfacePoint> under = surface_under(pointer_);
        zoom(session_->camera, under ? under->position : session_->camera.target, std::pow(0.9f, steps));
    }
}

void ViewerApp::fly_with_keys(double seconds) {
    if (ImGui::GetIO().WantCaptureKeyboard) return;
    const bool slow = window_.is_down(GLFW_KEY_LEFT_SHIFT) || window_.is_down(GLFW_KEY_RIGHT_SHIFT);
    // A scene's diagonal in ten seconds; a slow picture must not throw the camera through a wall.
    const float way = session_->scene_size * static_cast<float>(std::min(seconds, 0.1)) * (slow ? 0.01f : 0.1f);
    const auto along = [&](int more, int less) {
        return static_cast<float>(window_.is_down(more)) - static_cast<float>(window_.is_down(less));
    };
    const float right = along(GLFW_KEY_D, GLFW_KEY_A), up = along(GLFW_KEY_E, GLFW_KEY_Q),
                ahead = along(GLFW_KEY_W, GLFW_KEY_S);
    if (right != 0.0f || up != 0.0f || ahead != 0.0f) fly(session_->camera, way * right, way * up, way * ahead);
}

void ViewerApp::toggle_recording() {
    if (!recording_since_) {
        recording_since_ = clock_seconds();
        playing_since_.reset();
        path_.clear();
        message_ = "recording";
        return;
    }
    recording_since_.reset();
    const std::string file = free_name("path", {".json"}) + ".json";
    write_frame_path(file, path_);
    message_ = "wrote " + file + ", " + std::to_string(path_.size()) + " frames; space plays it";
}

void ViewerApp::record() {
    if (recording_since_)
        path_.push_back({clock_seconds() - *recording_since_, session_->camera, session_->light});
}

void ViewerApp::play() {
    if (!playing_since_) return;
    const double time = path_.front().time + clock_seconds() - *playing_since_;
    const Frame frame = frame_at(path_, time);
    const int width = session_->camera.width, height = session_->camera.height;
    session_->camera = frame.camera;
    session_->camera.width = width;
    session_->camera.height = height;
    set_light(frame.light);
    if (time >= path_.back().time) playing_since_.reset();
}

std::string ViewerApp::free_name(const std::string& stem, std::initializer_list<const char*> endings,
                                 bool always_numbered) const {
    for (int k = 0;; ++k) {
        std::string file = stem;
        if (k > 0 || always_numbered) file.append("_").append(std::to_string(k));
        const std::string name = (std::filesystem::path(options_.folder) / file).string();
        if (std::ranges::none_of(endings, [&](const char* ending) { return std::filesystem::exists(name + ending); }))
            return name;
    }
}

void ViewerApp::write_picture() {
    const std::string name = free_name("picture", {".png", ".exr"});
    const Image image = session_->renderer.read();
    Image shown = image; // as the window shows it
    if (is_light(layer_) && !tone_mapped_)
        for (float& value : shown.rgb) value *= exposure_;
    write_image(name + ".png", shown, PixelType::half_float,
                is_light(layer_) && tone_mapped_ ? std::optional(exposure_) : std::nullopt);
    write_image(name + ".exr", image, PixelType::full_float);
    message_ = "wrote " + name + ".png and .exr";
}

void ViewerApp::write_screenshot(const std::string& name) {
    const Gl& gl = window_.gl();
    const int width = window_.width(), height = window_.height();
    std::vector<unsigned char> bytes(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    gl.BindFramebuffer(GL_FRAMEBUFFER, 0);
    gl.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl.ReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, bytes.data());
    // OpenGL's first row is the bottom.
    const auto row = 3 * static_cast<std::ptrdiff_t>(width);
    for (int top = 0, bottom = height - 1; top < bottom; ++top, --bottom)
        std::swap_ranges(bytes.begin() + top * row, bytes.begin() + (top + 1) * row, bytes.begin() + bottom * row);
    write_png_bytes(name, width, height, bytes);
    message_ = "wrote " + name;
}

void ViewerApp::draw_picture() {
    Renderer& renderer = session_->renderer;
    renderer.draw(session_->camera, layer_, most_new_);
    const double patches = renderer.timings().patches;
    if (renderer.patches_missing() > 0 && patches > 0.0)
        most_new_ = std::clamp(static_cast<std::size_t>(static_cast<double>(most_new_)
                                                        * std::clamp(most_patch_seconds / patches, 0.5, 1.5)),
                               fewest_new, most_at_once);
    tone_map_.reset();
    if (tone_mapped_ && is_light(layer_)) tone_map_.emplace(renderer.read(), exposure_);
    times_.frame = renderer.timings();
    remember(frame_history_, times_.frame.total());
    drawn_ = session_->camera;
    picture_is_old_ = has_indirect_light(layer_) && renderer.patches_missing() > 0;
}

void ViewerApp::step() {
    const double time = clock_seconds(), seconds = time - last_time_;
    last_time_ = time;
    if (precompute_ && precompute_->state() != PrecomputeTask::State::at_work) {
        if (precompute_->state() == PrecomputeTask::State::done)
            open(precompute_->file());
        else
            message_ = precompute_->message();
        precompute_.reset();
    }
    if (!session_) {
        if (!precompute_ && !window_.should_close()) throw Error(message_);
        draw_waiting();
        return;
    }
    play();
    fly_with_keys(seconds);
    session_->camera.width = window_.width();
    session_->camera.height = window_.height();
    record();
    if (std::optional<LitField> lit = session_->light_thread.take()) {
        session_->renderer.set_light(lit->light, lit->field);
        session_->overlays.set_light(lit->light);
        times_.light = lit->statistics;
        remember(light_history_, lit->statistics.seconds());
        picture_is_old_ = true;
    }
    const Camera& camera = session_->camera;
    if (window_.width() < 1 || window_.height() < 1) return; // minimised
    if (camera != drawn_) picture_is_old_ = true;
    if (picture_is_old_) draw_picture();
    draw_window();
}

void ViewerApp::draw_waiting() {
    const Gl& gl = window_.gl();
    gl.BindFramebuffer(GL_FRAMEBUFFER, 0);
    gl.ClearColor(0.1f, 0.1f, 0.1f, 1.0f);
    gl.Clear(GL_COLOR_BUFFER_BIT);
    gui_.begin();
    ImGui::SetNextWindowPos({10.0f, 10.0f}, ImGuiCond_FirstUseEver);
    if (ImGui::Begin("Afterglow", nullptr, ImGuiWindowFlags_AlwaysAutoResize)) draw_precompute_panel();
    ImGui::End();
    gui_.end();
    window_.swap();
}

void ViewerApp::draw_window() {
    session_->renderer.composition().show(0, 0, 0, window_.width(), window_.height(), is_light(layer_),
                                          tone_map_, exposure_);
    gui_.begin();
    ImDrawList& over_picture = *ImGui::GetBackgroundDrawList();
    if (overlay_ != Overlay::none)
        session_->overlays.draw(over_picture, overlay_, overlay_level_, session_->camera,
                                session_->renderer.pixels());
    if (panels_) {
        draw_light(over_picture, session_->light, session_->camera, 0.05f * session_->scene_size);
        draw_panels();
    }
    gui_.end();
    if (picture_wanted_) attempt([&] { write_picture(); });
    if (screenshot_wanted_) attempt([&] { write_screenshot(free_name("window", {".png"}) + ".png"); });
    picture_wanted_ = screenshot_wanted_ = false;
    window_.swap();
}

void ViewerApp::run() {
    last_time_ = clock_seconds();
    while (!window_.should_close()) {
        const bool moves = picture_is_old_ || playing_since_ || recording_since_
                           || (session_ && session_->light_thread.is_busy());
        window_.handle_events(!session_ ? 0.1 : moves ? 0.0 : 0.05);
        step();
        const std::vector<std::string>& errors = window_.gl().errors();
        if (!errors.empty()) throw Error("OpenGL: " + errors.front());
    }
}

void ViewerApp::draw_panels() {
    ImGui::SetNextWindowPos({10.0f, 10.0f}, ImGuiCond_FirstUseEver);
    ImGui::SetNextWindowSize({310.0f, 0.0f}, ImGuiCond_FirstUseEver);
    if (ImGui::Begin("Afterglow", nullptr, ImGuiWindowFlags_AlwaysAutoResize)) {
        draw_view_panel();
        draw_light_panel();
        draw_times_panel();
        draw_file_panel();
        draw_precompute_panel();
        ImGui::Separator();
        ImGui::PushTextWrapPos(300.0f);
        ImGui::TextUnformatted(message_.c_str());
        ImGui::PopTextWrapPos();
    }
    ImGui::End();
}

void ViewerApp::draw_view_panel() {
    if (!ImGui::CollapsingHeader("View", ImGuiTreeNodeFlags_DefaultOpen)) return;
    int layer = static_cast<int>(layer_);
    for (int k = 0; k < view_layers; ++k) {
        if (k % 3 != 0) ImGui::SameLine(static_cast<float>(100 * (k % 3)));
        picture_is_old_ |= ImGui::RadioButton(view_layer_name(static_cast<ViewLayer>(k)), &layer, k);
    }
    layer_ = static_cast<ViewLayer>(layer);
    picture_is_old_ |= ImGui::Checkbox("tone map", &tone_mapped_);
    ImGui::SameLine(100.0f);
    ImGui::SetNextItemWidth(120.0f);
    picture_is_old_ |= ImGui::SliderFloat("exposure", &exposure_, 0.01f, 10.0f, "%.3f",
                                         ImGuiSliderFlags_Logarithmic | ImGuiSliderFlags_AlwaysClamp);
    int overlay = static_cast<int>(overlay_);
    ImGui::SetNextItemWidth(120.0f);
    ImGui::Combo("over it", &overlay, "nothing\0points\0coefficients\0links of a function\0");
    overlay_ = static_cast<Overlay>(overlay);
    if (overlay_ != Overlay::none) {
        ImGui::SetNextItemWidth(120.0f);
        ImGui::SliderInt("level", &overlay_level_, 0, session_->scene.file.transfer.points.levels() - 1, "%d",
                         ImGuiSliderFlags_AlwaysClamp);
    }
    int method = static_cast<int>(session_->renderer.method());
    ImGui::SetNextItemWidth(120.0f);
    if (ImGui::Combo("indirect by", &method, "splat\0gather\0the faster\0")) {
        session_->renderer.set_method(static_cast<IndirectMethod>(method));
        picture_is_old_ = true;
    }
}

void ViewerApp::draw_light_panel() {
    if (!ImGui::CollapsingHeader("Light", ImGuiTreeNodeFlags_DefaultOpen)) return;
    Spotlight light = session_->light;
    bool changed = ImGui::DragFloat3("position", light.position.data(), 0.002f * session_->scene_size);
    changed |= ImGui::DragFloatRange2("cone", &light.inner_angle, &light.outer_angle, 0.5f, 0.0f, 180.0f, "%.1f");
    float brightness = light.intensity.maxCoeff();
    Rgb colour = brightness > 0.0f ? Rgb(light.intensity / brightness) : Rgb::Ones();
    changed |= ImGui::DragFloat("W/sr", &brightness, 0.01f * std::max(brightness, 0.01f), 0.0f, 1e9f, "%.4g",
                                ImGuiSliderFlags_AlwaysClamp);
    Rgb picked = colour;
    if (ImGui::ColorEdit3("colour", picked.data(), ImGuiColorEditFlags_Float) && picked.maxCoeff() > 0.0f) {
        colour = picked / picked.maxCoeff(); // how bright it is, is said above
        changed = true;
    }
    if (!changed) return;
    light.intensity = brightness * colour;
    try {
        light.check();
        set_light(light);
    } catch (const UsageError& error) {
        message_ = error.what();
    }
}

void ViewerApp::draw_times_panel() {
    if (!ImGui::CollapsingHeader("Times [ms]", ImGuiTreeNodeFlags_DefaultOpen)) return;
    const FrameTimings& f = times_.frame;
    const MovingLightStatistics& l = times_.light;
    ImGui::Text("light %.1f: direct %.1f, coefficients %.1f,\n  links %.1f (%.0f %%), push %.1f", 1e3 * l.seconds(),
                1e3 * l.direct_seconds, 1e3 * l.coefficients_seconds, 1e3 * l.links_seconds, 100.0 * l.links_share,
                1e3 * l.push_seconds);
    ImGui::Text("picture %.1f: geometry %.1f, shadow map %.1f,\n  direct %.1f, patches %.1f, indirect %.1f,\n  composition %.1f",
                1e3 * f.total(), 1e3 * f.geometry, 1e3 * f.shadow_map, 1e3 * f.direct, 1e3 * f.patches,
                1e3 * f.indirect, 1e3 * f.composition);
    ImGui::PlotLines("picture", frame_history_.data(), static_cast<int>(frame_history_.size()), 0, nullptr, 0.0f, 300.0f, {200.0f, 40.0f});
    ImGui::PlotLines("light", light_history_.data(), static_cast<int>(light_history_.size()), 0, nullptr, 0.0f, 100.0f, {200.0f, 40.0f});
}

void ViewerApp::draw_file_panel() {
    if (!ImGui::CollapsingHeader("File")) return;
    const TransferFile& file = session_->scene.file;
    ImGui::Text("%s", session_->path.c_str());
    ImGui::Text("scene %s\noperator %s, %llu links", file.provenance.scene.c_str(),
                operator_name(file.transfer.kind), static_cast<unsigned long long>(file.transfer.link_count()));
    for (int l = 0; l < file.transfer.points.levels(); ++l)
        ImGui::Text("level %d: %u functions, spacing %.3g, %llu links", l,
                    file.transfer.points.end(l) - file.transfer.points.begin(l),
                    static_cast<double>(file.transfer.points.spacing[l]),
                    static_cast<unsigned long long>(file.transfer.link_count(l)));
    ImGui::Text("OpenGL by %s", window_.gl().renderer().c_str());
}

void ViewerApp::draw_precompute_panel() {
    if (!precompute_) return;
    ImGui::Separator();
    ImGui::Text("precomputing %s, %s", precompute_->file().c_str(), duration_text(precompute_->seconds()).c_str());
    ImGui::TextUnformatted(precompute_->message().c_str());
    ImGui::SameLine();
    if (ImGui::Button("cancel")) {
        precompute_.reset();
        message_ = "precomputation cancelled";
        if (!session_) window_.close(); // there is nothing else to show
    }
}

} // namespace afterglow

#pragma once

#include "viewer/glfw_window.h"

namespace afterglow {

/// Dear ImGui over a window: between begin() and end() panels are described, end() draws them over what is
/// in the window's framebuffer. One at a time.
class Gui {
public:
    /// Takes the window's events, and hands them on.
    explicit Gui(GlfwWindow& window);
    ~Gui();
    Gui(const Gui&) = delete;
    Gui& operator=(const Gui&) = delete;

    void begin();
    void end();
};

} // namespace afterglow

#include "viewer/glfw_window.h"

#include "core/error.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <cstdlib>

namespace afterglow {
namespace {

std::string last_error() {
    const char* words = nullptr;
    glfwGetError(&words);
    return words ? words : "no reason given";
}

GlfwWindow& of(GLFWwindow* window) {
    return *static_cast<GlfwWindow*>(glfwGetWindowUserPointer(window));
}

bool is_held(GLFWwindow* window, int left, int right) {
    return glfwGetKey(window, left) == GLFW_PRESS || glfwGetKey(window, right) == GLFW_PRESS;
}
bool shift(GLFWwindow* w) { return is_held(w, GLFW_KEY_LEFT_SHIFT, GLFW_KEY_RIGHT_SHIFT); }
bool control(GLFWwindow* w) { return is_held(w, GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL); }

} // namespace

GlfwWindow::GlfwWindow(int width, int height, const std::string& title) {
#ifdef GLFW_PLATFORM // GLFW 3.4 asks for Wayland first, which says a word of its own where nothing can be
    if (!std::getenv("XDG_RUNTIME_DIR")) glfwInitHint(GLFW_PLATFORM, GLFW_PLATFORM_X11);
#endif
    if (!glfwInit()) throw Error("no window: " + last_error() + "; give --headless, or set DISPLAY");
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, GLFW_TRUE);
    window_ = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
    if (!window_) {
        const std::string why = last_error();
        glfwTerminate();
        throw Error("no window with OpenGL 3.3: " + why);
    }
    glfwMakeContextCurrent(window_);
    try {
        gl_.emplace([](const char* name) { return reinterpret_cast<void*>(glfwGetProcAddress(name)); });
    } catch (...) {
        glfwDestroyWindow(window_);
        glfwTerminate();
        throw;
    }
    glfwSwapInterval(1);
    glfwSetWindowUserPointer(window_, this);
    glfwSetKeyCallback(window_, [](GLFWwindow* w, int key, int, int action, int) {
        if (action == GLFW_PRESS && of(w).events.key) of(w).events.key(key, shift(w), control(w));
    });
    glfwSetMouseButtonCallback(window_, [](GLFWwindow* w, int button, int action, int) {
        if (of(w).events.button) of(w).events.button(button, action == GLFW_PRESS, shift(w), control(w));
    });
    glfwSetCursorPosCallback(window_, [](GLFWwindow* w, double x, double y) {
        // The window's units may be larger than pixels.
        int width_in_units = 1, height_in_units = 1;
        glfwGetWindowSize(w, &width_in_units, &height_in_units);
        if (of(w).events.pointer && width_in_units > 0 && height_in_units > 0)
            of(w).events.pointer(x * of(w).width() / width_in_units, y * of(w).height() / height_in_units);
    });
    glfwSetScrollCallback(window_, [](GLFWwindow* w, double, double steps) {
        if (of(w).events.wheel) of(w).events.wheel(steps, shift(w), control(w));
    });
    glfwSetDropCallback(window_, [](GLFWwindow* w, int count, const char** paths) {
        if (count > 0 && of(w).events.drop) of(w).events.drop(paths[0]);
    });
}

GlfwWindow::~GlfwWindow() {
    gl_.reset();
    glfwDestroyWindow(window_);
    glfwTerminate();
}

void GlfwWindow::handle_events(double wait) {
    if (wait > 0.0)
        glfwWaitEventsTimeout(wait);
    else
        glfwPollEvents();
}

bool GlfwWindow::should_close() const { return glfwWindowShouldClose(window_) == GLFW_TRUE; }
void GlfwWindow::close() { glfwSetWindowShouldClose(window_, GLFW_TRUE); }

int GlfwWindow::width() const {
    int width = 0, height = 0;
    glfwGetFramebufferSize(window_, &width, &height);
    return width;
}

int GlfwWindow::height() const {
    int width = 0, height = 0;
    glfwGetFramebufferSize(window_, &width, &height);
    return height;
}

bool GlfwWindow::is_down(int key) const { return glfwGetKey(window_, key) == GLFW_PRESS; }
void GlfwWindow::set_title(const std::string& title) { glfwSetWindowTitle(window_, title.c_str()); }
void GlfwWindow::swap() { glfwSwapBuffers(window_); }

} // namespace afterglow

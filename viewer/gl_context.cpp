#include "viewer/gl_context.h"

#include "core/error.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/osmesa.h>

#include <array>
#include <optional>

namespace afterglow {
namespace {

std::string egl_error(const char* what) {
    std::array<char, 16> code{};
    std::snprintf(code.data(), code.size(), "0x%x", static_cast<unsigned>(eglGetError()));
    return std::string("EGL: ") + what + " failed (" + code.data()
           + "); try --context osmesa, or install libegl1 and libgl1-mesa-dri";
}

class EglContext : public GlContext {
public:
    EglContext() {
        display_ = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
        if (display_ == EGL_NO_DISPLAY) display_ = eglGetDisplay(EGL_DEFAULT_DISPLAY);
        if (display_ == EGL_NO_DISPLAY || !eglInitialize(display_, nullptr, nullptr))
            throw Error(egl_error("opening a display"));
        try {
            make_context();
        } catch (...) {
            close();
            throw;
        }
    }
    ~EglContext() override { close(); }
    const Gl& gl() const override { return *gl_; }

private:
    void make_context() {
        const std::array config_wanted = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE,
                                          EGL_OPENGL_BIT, EGL_NONE};
        EGLConfig config = nullptr;
        EGLint count = 0;
        if (!eglBindAPI(EGL_OPENGL_API)
            || !eglChooseConfig(display_, config_wanted.data(), &config, 1, &count) || count < 1)
            throw Error(egl_error("finding a configuration"));
        const std::array wanted = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 3,
                                   EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                   EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_CONTEXT_OPENGL_DEBUG,
                                   EGL_TRUE, EGL_NONE};
        context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, wanted.data());
        if (context_ == EGL_NO_CONTEXT) throw Error(egl_error("making a context of OpenGL 3.3"));
        if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
            throw Error(egl_error("using a context without a surface"));
        gl_.emplace([](const char* name) { return reinterpret_cast<void*>(eglGetProcAddress(name)); });
    }
    void close() {
        eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
        eglTerminate(display_);
    }

    EGLDisplay display_ = EGL_NO_DISPLAY;
    EGLContext context_ = EGL_NO_CONTEXT;
    std::optional<Gl> gl_;
};

class OsmesaContext : public GlContext {
public:
    OsmesaContext() {
        const std::array wanted = {OSMESA_FORMAT, OSMESA_RGBA, OSMESA_PROFILE, OSMESA_CORE_PROFILE,
                                   OSMESA_CONTEXT_MAJOR_VERSION, 3, OSMESA_CONTEXT_MINOR_VERSION, 3, 0};
        context_.reset(OSMesaCreateContextAttribs(wanted.data(), nullptr));
        if (!context_) throw Error("OSMesa: making a context of OpenGL 3.3 failed; install libosmesa6");
        if (!OSMesaMakeCurrent(context_.get(), pixels_.data(), GL_UNSIGNED_BYTE, side, side))
            throw Error("OSMesa: its context cannot be used");
        gl_.emplace([](const char* name) {
            return reinterpret_cast<void*>(OSMesaGetProcAddress(name));
        });
    }
    const Gl& gl() const override { return *gl_; }

private:
    struct Destroy {
        void operator()(OSMesaContext context) const { OSMesaDestroyContext(context); }
    };
    static constexpr int side = 4; // of a picture that nothing is drawn into
    std::array<unsigned char, 4 * side * side> pixels_{};
    std::unique_ptr<osmesa_context, Destroy> context_;
    std::optional<Gl> gl_;
};

} // namespace

std::unique_ptr<GlContext> make_offscreen_context(const std::string& name) {
    if (name == "egl") return std::make_unique<EglContext>();
    if (name == "osmesa") return std::make_unique<OsmesaContext>();
    if (name != "auto")
        throw UsageError("there is no context \"" + name + "\"; auto, egl and osmesa need no window");
    try {
        return std::make_unique<EglContext>();
    } catch (const Error& egl) {
        try {
            return std::make_unique<OsmesaContext>();
        } catch (const Error& osmesa) {
            throw Error(std::string("no OpenGL: ") + egl.what() + "; " + osmesa.what());
        }
    }
}

} // namespace afterglow

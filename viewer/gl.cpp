#include "viewer/gl.h"

#include "core/error.h"

namespace afterglow {

Gl::Gl(const Lookup& lookup) {
#define AFTERGLOW_FETCH(TYPE, NAME)                                                                \
    NAME = reinterpret_cast<PFNGL##TYPE##PROC>(lookup("gl" #NAME));                                \
    if (!NAME) throw Error("OpenGL has no function gl" #NAME "; 3.3 is the least that will do");
    AFTERGLOW_GL_FUNCTIONS(AFTERGLOW_FETCH)
#undef AFTERGLOW_FETCH
    GLint major = 0, minor = 0;
    GetIntegerv(GL_MAJOR_VERSION, &major);
    GetIntegerv(GL_MINOR_VERSION, &minor);
    const int version = 10 * major + minor;
    if (version < 33)
        throw Error("OpenGL " + std::to_string(major) + "." + std::to_string(minor)
                    + " is too old; 3.3 is the least that will do");
    if (version >= 45)
        ClipControl = reinterpret_cast<PFNGLCLIPCONTROLPROC>(lookup("glClipControl"));
    if (version >= 43)
        if (const auto callback = reinterpret_cast<PFNGLDEBUGMESSAGECALLBACKPROC>(
                lookup("glDebugMessageCallback"))) {
            Enable(GL_DEBUG_OUTPUT);
            Enable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
            callback(&report, this);
        }
}

void APIENTRY Gl::report(GLenum, GLenum type, GLuint, GLenum, GLsizei, const GLchar* message,
                         const void* gl) {
    if (type == GL_DEBUG_TYPE_ERROR || type == GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR)
        static_cast<const Gl*>(gl)->errors_.emplace_back(message);
}

std::string Gl::renderer() const {
    const GLubyte* text = GetString(GL_RENDERER);
    return text ? reinterpret_cast<const char*>(text) : "unknown";
}

const std::vector<std::string>& Gl::errors() const {
    // Without the driver's own words there is at least a number.
    for (GLenum error = GetError(); error != GL_NO_ERROR; error = GetError()) {
        if (errors_.size() >= 100) break;
        errors_.push_back("OpenGL error " + std::to_string(error));
    }
    return errors_;
}

} // namespace afterglow

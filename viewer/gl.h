#pragma once

#include <GL/glcorearb.h>

#include <functional>
#include <string>
#include <vector>

namespace afterglow {

// Every function of OpenGL that the viewer calls: the type's name and the function's.
#define AFTERGLOW_GL_FUNCTIONS(X)                                                                  \
    X(ACTIVETEXTURE, ActiveTexture) X(ATTACHSHADER, AttachShader)                                  \
    X(BINDATTRIBLOCATION, BindAttribLocation) X(BINDBUFFER, BindBuffer)                            \
    X(BINDFRAGDATALOCATION, BindFragDataLocation) X(BINDFRAMEBUFFER, BindFramebuffer)              \
    X(BINDTEXTURE, BindTexture) X(BINDVERTEXARRAY, BindVertexArray) X(BLENDFUNC, BlendFunc)        \
    X(BUFFERDATA, BufferData) X(BUFFERSUBDATA, BufferSubData)                                      \
    X(CHECKFRAMEBUFFERSTATUS, CheckFramebufferStatus) X(CLEAR, Clear)                              \
    X(CLEARBUFFERFV, ClearBufferfv) X(CLEARBUFFERUIV, ClearBufferuiv) X(CLEARCOLOR, ClearColor)    \
    X(COMPILESHADER, CompileShader) X(CREATEPROGRAM, CreateProgram) X(CREATESHADER, CreateShader)  \
    X(DELETEBUFFERS, DeleteBuffers) X(DELETEFRAMEBUFFERS, DeleteFramebuffers)                      \
    X(DELETEPROGRAM, DeleteProgram) X(DELETESHADER, DeleteShader)                                  \
    X(DELETETEXTURES, DeleteTextures) X(DELETEVERTEXARRAYS, DeleteVertexArrays)                    \
    X(DEPTHFUNC, DepthFunc) X(DISABLE, Disable) X(DRAWARRAYS, DrawArrays)  \
    X(DRAWARRAYSINSTANCED, DrawArraysInstanced) X(DRAWBUFFERS, DrawBuffers) X(ENABLE, Enable)      \
    X(ENABLEVERTEXATTRIBARRAY, EnableVertexAttribArray) X(FINISH, Finish)                          \
    X(FRAMEBUFFERTEXTURE2D, FramebufferTexture2D)                                                  \
    X(FRAMEBUFFERTEXTURELAYER, FramebufferTextureLayer) X(GENBUFFERS, GenBuffers)                  \
    X(GENFRAMEBUFFERS, GenFramebuffers) X(GENTEXTURES, GenTextures)                                \
    X(GENVERTEXARRAYS, GenVertexArrays) X(GETERROR, GetError) X(GETINTEGERV, GetIntegerv)          \
    X(GETPROGRAMINFOLOG, GetProgramInfoLog) X(GETPROGRAMIV, GetProgramiv)                          \
    X(GETSHADERINFOLOG, GetShaderInfoLog) X(GETSHADERIV, GetShaderiv) X(GETSTRING, GetString)      \
    X(GETUNIFORMLOCATION, GetUniformLocation) X(LINKPROGRAM, LinkProgram)                          \
    X(PIXELSTOREI, PixelStorei) X(READBUFFER, ReadBuffer) X(READPIXELS, ReadPixels)                \
    X(SHADERSOURCE, ShaderSource) X(TEXBUFFER, TexBuffer) X(TEXIMAGE2D, TexImage2D)                \
    X(TEXIMAGE3D, TexImage3D) X(TEXPARAMETERI, TexParameteri) X(TEXSUBIMAGE2D, TexSubImage2D)      \
    X(UNIFORM1F, Uniform1f) X(UNIFORM1I, Uniform1i) X(UNIFORM1UI, Uniform1ui)                      \
    X(UNIFORM2F, Uniform2f) X(UNIFORM3F, Uniform3f) X(UNIFORMMATRIX3FV, UniformMatrix3fv)          \
    X(UNIFORMMATRIX4FV, UniformMatrix4fv) X(USEPROGRAM, UseProgram)                                \
    X(VERTEXATTRIBPOINTER, VertexAttribPointer) X(VIEWPORT, Viewport)

/// The functions of one OpenGL context, 3.3 core or later, as its driver has them.
struct Gl {
#define AFTERGLOW_DECLARE(TYPE, NAME) PFNGL##TYPE##PROC NAME = nullptr;
    AFTERGLOW_GL_FUNCTIONS(AFTERGLOW_DECLARE)
#undef AFTERGLOW_DECLARE
    PFNGLCLIPCONTROLPROC ClipControl = nullptr; // of OpenGL 4.5; null before

    using Lookup = std::function<void*(const char*)>;
    /// Fetches all functions; the context must be current. Throws Error where one is missing or the
    /// version is below 3.3. Where the driver can, it reports its errors from then on, see errors().
    explicit Gl(const Lookup& lookup);
    Gl(const Gl&) = delete; // the driver knows its address
    Gl& operator=(const Gl&) = delete;

    std::string renderer() const; // the driver's name for itself
    /// What went wrong since the context was made, in the driver's words; empty when all is well.
    const std::vector<std::string>& errors() const;

private:
    mutable std::vector<std::string> errors_;
    static void APIENTRY report(GLenum source, GLenum type, GLuint id, GLenum severity,
                                GLsizei length, const GLchar* message, const void* gl);
};

} // namespace afterglow

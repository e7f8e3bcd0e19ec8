#include "viewer/gl_objects.h"

#include "core/error.h"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace afterglow {

const char* const whole_picture_vertex_shader = R"(
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
)";

GlName make_buffer(const Gl& gl) {
    GLuint name = 0;
    gl.GenBuffers(1, &name);
    return {gl, name, [](const Gl& g, GLuint n) { g.DeleteBuffers(1, &n); }};
}

GlName make_vertex_array(const Gl& gl) {
    GLuint name = 0;
    gl.GenVertexArrays(1, &name);
    return {gl, name, [](const Gl& g, GLuint n) { g.DeleteVertexArrays(1, &n); }};
}

GlName make_texture_name(const Gl& gl) {
    GLuint name = 0;
    gl.GenTextures(1, &name);
    return {gl, name, [](const Gl& g, GLuint n) { g.DeleteTextures(1, &n); }};
}

GlName make_texture(const Gl& gl, const TexelFormat& format, int width, int height,
                    const void* data) {
    GlName texture = make_texture_name(gl);
    gl.BindTexture(GL_TEXTURE_2D, texture);
    gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
    gl.TexImage2D(GL_TEXTURE_2D, 0, format.internal, width, height, 0, format.format, format.type, data);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    return texture;
}

GlName make_framebuffer(const Gl& gl, std::initializer_list<GLuint> colours, GLuint depth) {
    GLuint name = 0;
    gl.GenFramebuffers(1, &name);
    GlName framebuffer(gl, name, [](const Gl& g, GLuint n) { g.DeleteFramebuffers(1, &n); });
    gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    std::vector<GLenum> attachments;
    for (const GLuint colour : colours) {
        attachments.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(attachments.size()));
        gl.FramebufferTexture2D(GL_FRAMEBUFFER, attachments.back(), GL_TEXTURE_2D, colour, 0);
    }
    if (depth != 0)
        gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth, 0);
    if (attachments.empty()) attachments.push_back(GL_NONE);
    gl.DrawBuffers(static_cast<GLsizei>(attachments.size()), attachments.data());
    if (gl.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        throw Error("OpenGL cannot draw into the textures that the viewer needs (" + gl.renderer() + ")");
    return framebuffer;
}

DepthTest::DepthTest(const Gl& gl) : gl_(gl) {
    if (reversed()) gl_.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    gl_.Enable(GL_DEPTH_TEST);
    gl_.DepthFunc(reversed() ? GL_GREATER : GL_LESS);
}

DepthTest::~DepthTest() {
    gl_.Disable(GL_DEPTH_TEST);
    if (reversed()) gl_.ClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
}

void DepthTest::clear() const {
    const float farthest = reversed() ? 0.0f : 1.0f;
    gl_.ClearBufferfv(GL_DEPTH, 0, &farthest);
}

GlTextureBuffer::GlTextureBuffer(const Gl& gl, GLenum internal_format, std::size_t bytes_per_texel)
    : gl_(&gl), format_(internal_format), texel_bytes_(bytes_per_texel), buffer_(make_buffer(gl)),
      texture_(make_texture_name(gl)) {}

void GlTextureBuffer::set(const void* data, std::size_t count, std::size_t first_changed) {
    GLint most = 0;
    gl_->GetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most);
    if (count > static_cast<std::size_t>(most))
        throw Error("OpenGL can address " + std::to_string(most) + " texels of a buffer, not "
                    + std::to_string(count) + " (" + gl_->renderer() + ")");
    gl_->BindBuffer(GL_TEXTURE_BUFFER, buffer_);
    if (count > capacity_ || capacity_ == 0) {
        capacity_ = std::min(std::max<std::size_t>(1, count + count / 2), static_cast<std::size_t>(most));
        gl_->BufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(capacity_ * texel_bytes_), nullptr,
                        GL_DYNAMIC_DRAW);
        gl_->BindTexture(GL_TEXTURE_BUFFER, texture_);
        gl_->TexBuffer(GL_TEXTURE_BUFFER, format_, buffer_);
        first_changed = 0;
    }
    if (count > first_changed)
        gl_->BufferSubData(GL_TEXTURE_BUFFER, static_cast<GLintptr>(first_changed * texel_bytes_),
                           static_cast<GLsizeiptr>((count - first_changed) * texel_bytes_),
                           static_cast<const std::byte*>(data) + first_changed * texel_bytes_);
}

namespace {

/// Throws Error with OpenGL's own words unless a shader was compiled, or a program linked.
void require(GLuint object, GLenum status, PFNGLGETSHADERIVPROC get,
             PFNGLGETSHADERINFOLOGPROC get_log, const std::string& what) {
    GLint good = GL_FALSE;
    get(object, status, &good);
    if (good == GL_TRUE) return;
    std::string log(2000, '\0');
    GLsizei length = 0;
    get_log(object, static_cast<GLsizei>(log.size()), &length, log.data());
    throw Error("OpenGL does not " + what + ": " + log.substr(0, static_cast<std::size_t>(length)));
}

GlName compile(const Gl& gl, GLenum type, const std::string& name, const std::string& source) {
    GlName shader(gl, gl.CreateShader(type), [](const Gl& g, GLuint n) { g.DeleteShader(n); });
    const std::string whole = "#version 330 core\n" + source;
    const char* text = whole.c_str();
    gl.ShaderSource(shader, 1, &text, nullptr);
    gl.CompileShader(shader);
    require(shader, GL_COMPILE_STATUS, gl.GetShaderiv, gl.GetShaderInfoLog, "compile the shader " + name);
    return shader;
}

} // namespace

GlProgram::GlProgram(const Gl& gl, const std::string& name, const std::string& vertex,
                     const std::string& fragment, std::initializer_list<const char*> attributes,
                     std::initializer_list<const char*> outputs)
    : gl_(&gl), program_(gl, gl.CreateProgram(), [](const Gl& g, GLuint n) { g.DeleteProgram(n); }) {
    const GlName shaders[] = {compile(gl, GL_VERTEX_SHADER, name, vertex),
                              compile(gl, GL_FRAGMENT_SHADER, name, fragment)};
    for (const GlName& shader : shaders) gl.AttachShader(program_, shader);
    GLuint location = 0;
    for (const char* attribute : attributes) gl.BindAttribLocation(program_, location++, attribute);
    location = 0;
    for (const char* output : outputs) gl.BindFragDataLocation(program_, location++, output);
    gl.LinkProgram(program_);
    require(program_, GL_LINK_STATUS, gl.GetProgramiv, gl.GetProgramInfoLog, "link the shaders " + name);
}

void GlProgram::bind(const char* name, int unit, GLenum target, GLuint texture) const {
    gl_->ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    gl_->BindTexture(target, texture);
    set(name, unit);
}

} // namespace afterglow

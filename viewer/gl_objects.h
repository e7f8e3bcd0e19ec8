#pragma once

#include "core/types.h"
#include "viewer/gl.h"

#include <initializer_list>
#include <span>
#include <string>
#include <utility>

namespace afterglow {

/// A name that OpenGL gave to something of ours; it is deleted with its owner. Movable.
class GlName {
public:
    using Delete = void (*)(const Gl&, GLuint);
    GlName() = default;
    GlName(const Gl& gl, GLuint name, Delete destroy) : gl_(&gl), name_(name), delete_(destroy) {}
    GlName(GlName&& other) noexcept { swap(other); }
    GlName& operator=(GlName&& other) noexcept {
        swap(other);
        return *this;
    }
    ~GlName() {
        if (name_ != 0) delete_(*gl_, name_);
    }
    operator GLuint() const { return name_; }

private:
    const Gl* gl_ = nullptr;
    GLuint name_ = 0;
    Delete delete_ = nullptr;
    void swap(GlName& other) {
        std::swap(gl_, other.gl_);
        std::swap(name_, other.name_);
        std::swap(delete_, other.delete_);
    }
};

GlName make_buffer(const Gl& gl);
GlName make_vertex_array(const Gl& gl);
GlName make_texture_name(const Gl& gl); // of a texture of any kind, still without content

/// What a texture holds, as OpenGL wants to be told.
struct TexelFormat {
    GLint internal;
    GLenum format, type;
};
inline constexpr TexelFormat float4_texels = {GL_RGBA32F, GL_RGBA, GL_FLOAT};
inline constexpr TexelFormat half4_texels = {GL_RGBA16F, GL_RGBA, GL_FLOAT};
inline constexpr TexelFormat byte4_texels = {GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE};
inline constexpr TexelFormat index_texels = {GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT};
inline constexpr TexelFormat depth_texels = {GL_DEPTH_COMPONENT32F, GL_DEPTH_COMPONENT, GL_FLOAT};

/// A two-dimensional texture without levels, read texel by texel unless told otherwise; its size in
/// pixels. `data` may be null.
GlName make_texture(const Gl& gl, const TexelFormat& format, int width, int height,
                    const void* data = nullptr);

/// A framebuffer that draws into these textures, in order, and the depth texture, where there is one.
/// Throws Error where the driver cannot.
GlName make_framebuffer(const Gl& gl, std::initializer_list<GLuint> colours, GLuint depth = 0);

/// While it lives, what is nearest is drawn: with depths near / z, which keep their digits far away, where
/// OpenGL can (4.5), else with the usual ones. See view_transform().
class DepthTest {
public:
    explicit DepthTest(const Gl& gl);
    ~DepthTest();
    DepthTest(const DepthTest&) = delete;
    DepthTest& operator=(const DepthTest&) = delete;

    bool reversed() const { return gl_.ClipControl != nullptr; }
    /// Of the framebuffer in use.
    void clear() const;

private:
    const Gl& gl_;
};

/// Data that shaders read by index (samplerBuffer); grows as needed.
class GlTextureBuffer {
public:
    GlTextureBuffer(const Gl& gl, GLenum internal_format, std::size_t bytes_per_texel);
    /// `count` texels, of which those before `first_changed` are there already. Throws Error where
    /// they are more than the driver can address.
    void set(const void* data, std::size_t count, std::size_t first_changed = 0);
    GLuint texture() const { return texture_; }

private:
    const Gl* gl_;
    GLenum format_;
    std::size_t texel_bytes_, capacity_ = 0;
    GlName buffer_, texture_;
};

/// A vertex and a fragment shader. Attributes get their locations in the order they are named,
/// fragment outputs too.
class GlProgram {
public:
    /// Sources without their #version line. Throws Error with the compiler's words.
    GlProgram(const Gl& gl, const std::string& name, const std::string& vertex,
              const std::string& fragment, std::initializer_list<const char*> attributes,
              std::initializer_list<const char*> outputs);

    void use() const { gl_->UseProgram(program_); }
    /// Uniforms of the program in use; names that it does not have are passed over.
    void set(const char* name, int value) const { gl_->Uniform1i(at(name), value); }
    void set(const char* name, unsigned value) const { gl_->Uniform1ui(at(name), value); }
    void set(const char* name, float value) const { gl_->Uniform1f(at(name), value); }
    void set(const char* name, const Vec2& v) const { gl_->Uniform2f(at(name), v.x(), v.y()); }
    void set(const char* name, const Vec3& v) const { gl_->Uniform3f(at(name), v.x(), v.y(), v.z()); }
    void set(const char* name, const Rgb& v) const { gl_->Uniform3f(at(name), v[0], v[1], v[2]); }
    void set(const char* name, const Eigen::Matrix3f& m) const {
        gl_->UniformMatrix3fv(at(name), 1, GL_FALSE, m.data());
    }
    void set(const char* name, const Eigen::Matrix4f& m) const {
        gl_->UniformMatrix4fv(at(name), 1, GL_FALSE, m.data());
    }
    /// Binds a texture to a unit and the sampler of that name to the unit.
    void bind(const char* name, int unit, GLenum target, GLuint texture) const;

private:
    const Gl* gl_;
    GlName program_;
    GLint at(const char* name) const { return gl_->GetUniformLocation(program_, name); }
};

/// The vertex shader of passes over the whole picture: three vertices without attributes, whose
/// triangle covers it.
extern const char* const whole_picture_vertex_shader;

} // namespace afterglow

#pragma once

#include "viewer/gl.h"

#include <memory>
#include <string>

namespace afterglow {

/// An OpenGL context, current in the thread that made it; everything drawn goes into framebuffer
/// objects, so that a context needs no window.
class GlContext {
public:
    virtual ~GlContext() = default;
    GlContext(const GlContext&) = delete;
    GlContext& operator=(const GlContext&) = delete;

    virtual const Gl& gl() const = 0;

protected:
    GlContext() = default;
};

/// "egl" (surfaceless), "osmesa" (in software), or "auto": the first of these that works. Throws Error
/// where it does not, saying why; UsageError for another name.
std::unique_ptr<GlContext> make_offscreen_context(const std::string& name);

} // namespace afterglow

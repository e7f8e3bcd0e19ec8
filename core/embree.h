#pragma once

// Embree 3 or 4, whichever CMake has found: what of their interfaces differs is in this file alone.
// Of the libraries only surface.cpp sees it; it is not installed.

#if AFTERGLOW_EMBREE_MAJOR == 3
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

#if RTC_VERSION_MAJOR != AFTERGLOW_EMBREE_MAJOR
#error "Embree's headers are not of the version that CMake has found"
#endif

namespace afterglow {

#if AFTERGLOW_EMBREE_MAJOR == 3

// Embree 3 wants a context with each query.
inline RTCIntersectContext embree_context() {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    return context;
}
inline void embree_intersect(RTCScene scene, RTCRayHit& query) {
    RTCIntersectContext context = embree_context();
    rtcIntersect1(scene, &context, &query);
}
inline void embree_intersect(const int* valid, RTCScene scene, RTCRayHit8& packet, bool coherent) {
    RTCIntersectContext context = embree_context();
    if (coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect8(valid, scene, &context, &packet);
}
inline void embree_occluded(RTCScene scene, RTCRay& query) {
    RTCIntersectContext context = embree_context();
    rtcOccluded1(scene, &context, &query);
}
inline void embree_occluded(const int* valid, RTCScene scene, RTCRay8& packet) {
    RTCIntersectContext context = embree_context();
    rtcOccluded8(valid, scene, &context, &packet);
}

#else

// Embree 4 has a context of its own where none is given, and takes rays for incoherent as Embree 3 does.
inline void embree_intersect(RTCScene scene, RTCRayHit& query) { rtcIntersect1(scene, &query); }
inline void embree_intersect(const int* valid, RTCScene scene, RTCRayHit8& packet, bool coherent) {
    RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    if (coherent) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    rtcIntersect8(valid, scene, &packet, &arguments);
}
inline void embree_occluded(RTCScene scene, RTCRay& query) { rtcOccluded1(scene, &query); }
inline void embree_occluded(const int* valid, RTCScene scene, RTCRay8& packet) {
    rtcOccluded8(valid, scene, &packet);
}

#endif

} // namespace afterglow

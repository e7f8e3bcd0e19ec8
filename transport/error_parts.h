#pragma once

#include "core/surface.h"
#include "transport/path_tracer.h"
#include "transport/transfer_operator.h"
#include "transport/verification.h"

#include <string>

namespace afterglow {

/// A root mean square over places, lights and colours, relative to a light's mean irradiance (root mean square
/// over the lights), noise taken out; and its standard error over the choice of places.
struct ErrorPart {
    double rms = 0.0, standard_error = 0.0;
};

/// What an operator's error is made of.
struct ErrorParts {
    /// Irradiance gathered at the places by fresh rays, from what the operator says that the senders
    /// radiate, against the reference: projection onto the senders, over all bounces.
    ErrorPart senders;
    /// The operator's own irradiance at the display points next to the places against one gathered
    /// there by fresh rays: the noise of its rays, and the links that were dropped.
    ErrorPart links;
    /// What is left of the difference between the operator and a gather at the places: irradiance
    /// between display points.
    ErrorPart receivers;
    bool any() const { return senders.rms > 0.0 || links.rms > 0.0 || receivers.rms > 0.0; }
    /// For a person, in one line.
    std::string text() const;
};

/// How closely it looks: at so many of the places, with so many rays at each and at its display point.
struct ErrorPartsOptions {
    int places = 250;
    int rays = 256; // even
};

/// Of an operator that is not the paper's, under a trial that is not empty with its reference. A ray takes
/// one core 2 to 3 us.
ErrorParts error_parts(const Surface& surface, const TransferOperator& transfer, const Trial& trial,
                       const IrradianceEstimate& reference, const ErrorPartsOptions& options = {});

} // namespace afterglow

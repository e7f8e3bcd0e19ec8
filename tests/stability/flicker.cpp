#include "tests/stability/flicker.h"

#include "core/error.h"
#include "transport/display.h"
#include "transport/moving_light.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace afterglow {
namespace {

constexpr int block = 16; // pixels a side

/// Where the middles of a picture's pixels lie, and the reflectance there.
struct Pixels {
    int across, down; // blocks
    std::vector<SurfacePoint> at;
    Eigen::Array3Xf reflectance; // 3 x pixels

    Pixels(const Surface& surface, const Camera& camera)
        : across(camera.width / block), down(camera.height / block),
          reflectance(3, static_cast<Index>(camera.width) * camera.height) {
        for (int y = 0; y < camera.height; ++y)
            for (int x = 0; x < camera.width; ++x) {
                const Vec3 direction =
                    camera.direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
                const Hit hit = surface.closest_hit({camera.position, direction});
                if (!hit) throw Error("the camera sees past the scene");
                reflectance.col(static_cast<Index>(at.size())) = surface.reflectance(hit);
                at.push_back(surface.point(hit));
            }
    }
    int blocks() const { return across * down; }

    /// Means of radiance rho E / pi over blocks and colours; irradiance_of(pixel) gives E.
    template <class IrradianceOf>
    Eigen::ArrayXd block_means(const IrradianceOf& irradiance_of) const {
        Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(blocks());
        const Index width = static_cast<Index>(across) * block;
        for (Index k = 0; k < reflectance.cols(); ++k) {
            const Rgb radiance =
                reflectance.col(k) * irradiance_of(k) / static_cast<float>(EIGEN_PI);
            sum[k / width / block * across + k % width / block] += radiance.mean();
        }
        return sum / (block * block);
    }
};

Eigen::ArrayXXd changes(const Eigen::ArrayXXd& of_frame) {
    const Index frames = of_frame.cols();
    return of_frame.rightCols(frames - 1) - of_frame.leftCols(frames - 1);
}

} // namespace

double Flicker::net_rms() const {
    return std::sqrt(std::max(0.0, rms * rms - noise * noise));
}

Flicker measure_flicker(const Surface& surface, const TransferOperator& transfer,
                        std::span<const Spotlight> frames, const Camera& camera,
                        const FlickerOptions& options) {
    const Pixels pixels(surface, camera);
    const auto frame_count = static_cast<Index>(frames.size());

    Eigen::ArrayXXd ours(pixels.blocks(), frame_count);
    const LightTransport transport(transfer, surface);
    MovingLight moving(transport, {});
    const Display display(transfer, surface);
    for (Index f = 0; f < frame_count; ++f) {
        const Spotlight& light = frames[static_cast<std::size_t>(f)];
        const VectorIrradiance& field = moving.follow(light);
        const Eigen::Array3Xf irradiance = display.irradiance(pixels.at, field, light);
        ours.col(f) = pixels.block_means([&](Index k) -> Rgb { return irradiance.col(k); });
    }

    Eigen::ArrayXXd reference = Eigen::ArrayXXd::Zero(pixels.blocks(), frame_count);
    std::vector<Eigen::ArrayXXd> change_of_run;
    for (int run = 0; run < options.runs; ++run) {
        PathTracerOptions tracer; // its `plain` paths do not depend on the lights
        tracer.samples = options.samples_per_run;
        tracer.seed = options.seed + static_cast<std::uint64_t>(run);
        const IrradianceEstimate estimate = estimate_irradiance(surface, frames, pixels.at, tracer);
        Eigen::ArrayXXd means(pixels.blocks(), frame_count);
        for (Index f = 0; f < frame_count; ++f)
            means.col(f) = pixels.block_means(
                [&](Index k) -> Rgb { return estimate.indirect.col(k * frame_count + f); });
        reference += means / options.runs;
        change_of_run.push_back(changes(means));
    }

    const Eigen::ArrayXd unit = reference.rowwise().mean(); // of a block
    const Eigen::ArrayXXd true_change = changes(reference);
    const Eigen::ArrayXXd beyond = (changes(ours) - true_change).colwise() / unit;
    double variance = 0.0; // of the mean over the runs
    for (const Eigen::ArrayXXd& change : change_of_run)
        variance += ((change - true_change).colwise() / unit).square().mean()
                    / (options.runs * (options.runs - 1.0));
    std::vector<double> sizes;
    for (const double b : beyond.reshaped())
        sizes.push_back(std::abs(b));
    std::ranges::sort(sizes);
    const Eigen::ArrayXd our_jumps = changes(ours).abs().rowwise().maxCoeff();
    const Eigen::ArrayXd true_jumps = true_change.abs().rowwise().maxCoeff();
    return {std::sqrt(beyond.square().mean()), sizes[(sizes.size() * 95 - 1) / 100], sizes.back(),
            std::sqrt(variance), std::sqrt((true_change.colwise() / unit).square().mean()),
            (our_jumps / true_jumps).maxCoeff()};
}

} // namespace afterglow

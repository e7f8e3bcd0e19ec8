#pragma once

#include "transport/display_field.h"
#include "transport/moving_light.h"
#include "transport/spotlight.h"

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace afterglow {

/// A light with the field that it makes: what a picture is lit by, as a whole.
struct LitField {
    Spotlight light;
    std::shared_ptr<const DisplayField> field;
    MovingLightStatistics statistics;
};

/// Solves for the light in a thread of its own, so that pictures never wait: the newest pose wins, those
/// that came in between are passed over. A pose that has not settled is solved again until it has, or
/// another comes.
class LightThread {
public:
    using Solve = std::function<LitField(const Spotlight&)>;
    explicit LightThread(Solve solve);
    /// Waits for the pose at work.
    ~LightThread();
    LightThread(const LightThread&) = delete;
    LightThread& operator=(const LightThread&) = delete;

    void set(const Spotlight& light);
    /// The newest result, once; nothing where there is none since the last call. Throws Error where the
    /// solver failed.
    std::optional<LitField> take();
    /// Whether a result is still to come.
    bool is_busy() const;

private:
    Solve solve_;
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::optional<Spotlight> wanted_;
    std::optional<LitField> result_;
    std::optional<std::string> failure_;
    bool at_work_ = false, stop_ = false;
    std::thread thread_;

    void run();
};

} // namespace afterglow

#pragma once

#include "core/error.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace afterglow {

/// What the FileError says that the action throws, or "no FileError".
inline std::string message_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const FileError& error) {
        return error.what();
    }
    return "no FileError";
}

/// "accepted", or what the FileError says, which must be one short line.
inline std::string refusal_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const FileError& error) {
        const std::string message = error.what();
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        EXPECT_LT(message.size(), 400u);
        return message;
    }
    return "accepted";
}

} // namespace afterglow

#pragma once

#include <string>

namespace active_matching_slam {

/// Writes `content` to `path`, replacing what was there. Throws std::runtime_error that names the
/// file when it can't be opened or when the disk did not take all of it.
void writeTextFile(const std::string& path, const std::string& content);

/// A number as text that reads back bit for bit; "nan" and "inf" as they are. Never uses a locale.
std::string numberText(double value);

}  // namespace active_matching_slam

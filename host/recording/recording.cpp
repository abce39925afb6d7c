// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recording.hpp"

#include "recorder.hpp"

namespace r4 {

Recording::Recording(const std::string& path, RecordingOptions options)
    : recorder_(std::make_shared<Recorder>(path, options)) {}
Recording::~Recording() { recorder_->close(); }

void Recording::close() { recorder_->close(); }
std::optional<Problem> Recording::problem() const { return recorder_->problem(); }
std::uint64_t Recording::records() const { return recorder_->records(); }
std::uint64_t Recording::dropped() const { return recorder_->dropped(); }

}  // namespace r4

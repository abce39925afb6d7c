// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../formats/conversion.hpp"
#include "../formats/packets/packets.hpp"
#include "r4link/devices/device.hpp"

namespace r4::tool {

// Damaged places reported one by one. Further places are only counted.
constexpr std::size_t most_damage = 20;

// The name for messages; "-" is standard input.
std::string called(const std::string& path);

struct SourceOptions {
  std::uint16_t port = board_port;  // UDP port of boards in a capture
  std::optional<Time> start;        // time of the first frame of a candump log with relative times
};

// Reads a file of any format; "-" is standard input. Throws Error{usage} for a write-only format.
std::unique_ptr<Source> make_source(const std::string& path, RecordingVisitor& visitor,
                                    const SourceOptions& options = {});

// Throws Error{usage} for an unknown ending, and for `devices` with a format other than .csv,
// .jsonl and .mcap. These formats show the values of `devices` instead of the recorded devices.
std::unique_ptr<Sink> make_sink(const std::string& path, Output& output,
                                std::vector<Device> devices = {});

}  // namespace r4::tool

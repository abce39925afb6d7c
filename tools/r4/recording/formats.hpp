// SPDX-License-Identifier: GPL-3.0-or-later
// The formats of recordings that r4 reads, by what is in a file, and writes, by the ending of its name.
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

// So many places of damage are told; of more than that, how many.
constexpr std::size_t most_damage = 20;

// What people call the file of that name: "-" is the standard input.
std::string called(const std::string& path);

struct SourceOptions {
  std::uint16_t port = board_port;  // of boards in a capture of UDP
  std::optional<Time> start;        // of a log of candump whose times count from its first frame
};

// Reads the file of that name, "-" being the standard input, whatever its format. Throws Error{usage} for a format that
// is only written.
std::unique_ptr<Source> make_source(const std::string& path, RecordingVisitor& visitor,
                                    const SourceOptions& options = {});

// Writes the file of that name. Throws Error{usage} where its ending is none that is written.
// Of `devices` .csv, .jsonl and .mcap tell what they have measured, instead of those of the recording; Error{usage} for
// them with another.
std::unique_ptr<Sink> make_sink(const std::string& path, Output& output,
                                std::vector<Device> devices = {});

}  // namespace r4::tool

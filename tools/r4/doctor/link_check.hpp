// SPDX-License-Identifier: GPL-3.0-or-later
// How well a link does: listened to for some seconds as one that watches, which commands nothing.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "finding.hpp"

namespace r4::tool {

struct LinkSample {
  double seconds = 0;
  std::uint64_t received = 0;  // valid datagrams of the board
  std::uint64_t states = 0;
  std::uint64_t lost = 0;
  std::uint64_t damaged = 0;
  double jitter_us = 0;
};

// The verdict.
Findings judge_link(const std::string& url, const LinkSample& sample);

struct HeardLink {
  std::string url;
  LinkSample sample;
  Findings findings;
};

// Listens to all at once. What cannot be opened, and a board that says nothing, are findings.
std::vector<HeardLink> listen_to_links(const std::vector<std::string>& urls,
                                       std::chrono::milliseconds duration);

}  // namespace r4::tool

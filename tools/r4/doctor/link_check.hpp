// SPDX-License-Identifier: GPL-3.0-or-later
// Measures a link as a watcher, for some seconds. Requests the board's identity, to test both
// directions. On a CAN bus with another host, the questions of that host are used.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "finding.hpp"
#include "r4link/carrier.hpp"

namespace r4::tool {

enum class Answered : std::uint8_t {
  not_asked,  // no time, another host uses the bus, or a recording
  no,
  yes,
};

struct LinkSample {
  double seconds = 0;
  std::uint64_t received = 0;
  std::uint64_t states = 0;
  std::uint64_t lost = 0;
  std::uint64_t damaged = 0;
  double jitter_us = 0;
  Answered answered = Answered::not_asked;
  double answer_us = 0;  // fastest time from question to answer; 0: not measured
  TransportTrouble trouble = TransportTrouble::none;
  Problem link;
};

// The result is "ok" only if states and a timely answer arrived.
Findings judge_link(const std::string& url, const LinkSample& sample);

struct HeardLink {
  std::string url;
  LinkSample sample;
  Findings findings;
};

// Listens to all links at once. A link that cannot be opened and a silent board become findings.
std::vector<HeardLink> listen_to_links(const std::vector<std::string>& urls,
                                       std::chrono::milliseconds duration);

}  // namespace r4::tool

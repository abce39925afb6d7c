// SPDX-License-Identifier: GPL-3.0-or-later
// How well a link does: listened to for some seconds as one that watches, which commands nothing.
// The board is asked who it is, so that both directions are tried; on a CAN bus with a host that
// host asks, and its answers are heard.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "finding.hpp"
#include "r4link/carrier.hpp"

namespace r4::tool {

enum class Answered : std::uint8_t {
  not_asked,  // there was no time, another host has the bus, or it is a recording
  no,
  yes,
};

struct LinkSample {
  double seconds = 0;
  std::uint64_t received = 0;  // valid datagrams of the board
  std::uint64_t states = 0;
  std::uint64_t lost = 0;
  std::uint64_t damaged = 0;
  double jitter_us = 0;
  Answered answered = Answered::not_asked;
  double answer_us = 0;  // question to answer, the fastest; 0: not measured
  TransportTrouble trouble = TransportTrouble::none;
  Problem link;  // what explain() says of the link
};

// The verdict. "ok" takes states, and an answer in time.
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

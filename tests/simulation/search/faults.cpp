// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <charconv>
#include <stdexcept>

#include "story.hpp"

namespace r4::simulation {
namespace {

struct Description {
  const char* word;
  const char* text;
};

// The descriptions are in the order of Fault::Kind.
constexpr Description descriptions[] = {
    {"lost", "is lost"},
    {"twice", "arrives twice"},
    {"again-late", "arrives, and 300 ms later a second time"},
    {"again-too-late", "arrives, and 1.3 s later a second time"},
    {"late", "arrives 300 ms late"},
    {"too-late", "arrives 1.3 s late"},
    {"overtaken", "is overtaken by the next one"},
    {"cut", "the path carries nothing for 1.3 s"},
    {"cut-to-board", "the path carries nothing toward the board for 1.3 s"},
    {"cut-to-host", "the path carries nothing toward the host for 1.3 s"},
    {"cut-shortly", "the path carries nothing for 0.4 s"},
    {"held", "what is sent on the path in the next 1.3 s arrives after them, at once"},
    {"unplugged", "the path is unplugged at both ends for 1.3 s, which their systems report"},
    {"port-lost", "the board loses the transport for a moment"},
    {"restarts", "the host is killed, and restarts after 50 ms"},
    {"dies", "the host is killed, and restarts after 1.3 s"},
    {"sleeps", "the host's computer sleeps for 1.5 s"},
    {"pauses", "the host process is paused for 1.3 s"},
    {"moves", "the host's address changes"},
    {"stops", "the host asks for an emergency stop"},
    {"clears", "the host clears what it knows to be wrong"},
    {"reboots", "the board restarts"},
    {"stands-still", "the board's loop stands still for 1.2 s"},
    {"other-stops", "another program asks for an emergency stop"},
    {"bridge-restarts", "the bridge restarts"},
    {"stranger-beats", "a stranger sends one heartbeat with the host's next number"},
    {"stranger-drives", "a stranger sends one command with the host's next number"},
    {"stranger-leaves", "a stranger says farewell with the host's next number"},
    {"stranger-clears", "a stranger clears what is wrong with the host's next number"},
    {"stranger-joins",
     "from here on a stranger sends heartbeats and commands as if it were the host"},
    {"stranger-is-paper",
     "from here on a stranger sends heartbeats and commands as the paper's host does"},
    {"stranger-competes", "from here on a stranger is another host, with a session of its own"},
    {"stranger-elsewhere",
     "from here on a stranger sends heartbeats and commands as if it were the host, on another "
     "path"},
    {"stranger-inherits",
     "from here on a stranger sends heartbeats and commands from the first host's address whenever "
     "no host has it"},
    {"stranger-copies", "a stranger sends a copy of it from an address of its own"},
};
static_assert(std::size(descriptions) == static_cast<std::size_t>(Fault::Kind::count));

}  // namespace

const char* word_of(Fault::Kind kind) { return descriptions[static_cast<int>(kind)].word; }
const char* text_of(Fault::Kind kind) { return descriptions[static_cast<int>(kind)].text; }

std::string to_text(const std::vector<Fault>& faults) {
  std::string text;
  for (const Fault& fault : faults) {
    text += fmt::format("{}{}:{}", text.empty() ? "" : " ", fault.step, word_of(fault.kind));
  }
  return text;
}

std::vector<Fault> faults_from(std::string_view text) {
  std::vector<Fault> faults;
  while (!text.empty()) {
    const std::string_view one = text.substr(0, text.find(' '));
    text.remove_prefix(std::min(text.size(), one.size() + 1));
    if (one.empty()) continue;
    Fault fault{0, Fault::Kind::lost};
    const char* const end = one.data() + one.size();
    const auto number = std::from_chars(one.data(), end, fault.step);
    bool known = false;
    for (int i = 0; i < static_cast<int>(Fault::Kind::count) && number.ptr != end; ++i) {
      fault.kind = static_cast<Fault::Kind>(i);
      known = std::string_view(number.ptr + 1, end) == word_of(fault.kind);
      if (known) break;
    }
    if (!known) {
      throw std::invalid_argument(
          fmt::format("{} is not a valid fault: expected STEP:KIND", std::string(one)));
    }
    faults.push_back(fault);
  }
  return faults;
}

}  // namespace r4::simulation

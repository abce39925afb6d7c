// SPDX-License-Identifier: GPL-3.0-or-later
// A host program with several paths to its board, for host_on_paths.py. The program sends one
// command after another, and reports all states, ends of commands and changes of paths.
//
//     host_on_paths URL...                     ends when its input ends
//
//     {"type":"state","at":12.345678,"t":…}                       at: time of reception, monotonic clock
//     {"type":"command","command":"S:1000,1","confirmed":true}
//     {"type":"path","at":…,"name":…,"carries":true}
//     {"type":"link","at":…,"active":true,"state":"active","reason":"none"}
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "r4link/board.hpp"

namespace {

using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

double seconds(Clock::time_point at) {
  return std::chrono::duration<double>(at.time_since_epoch()).count();
}

void print(const Json& object) {
  static std::mutex mutex;
  const std::string line = object.dump() + "\n";
  const std::lock_guard lock(mutex);
  std::fputs(line.c_str(), stdout);
  std::fflush(stdout);
}

// True until the other end closes our input.
bool wanted() {
  pollfd input{0, POLLIN, 0};
  return ::poll(&input, 1, 0) == 0;
}

void work(const std::vector<std::string>& urls) {
  r4::BoardOptions options;
  options.session.arming = r4::Arming::off;
  r4::BoardCallbacks callbacks;
  callbacks.on_path = [](const r4::PathStatus& path) {
    const bool carries = path.state == r4::PathState::carrying;
    print({{"type", "path"},
           {"at", seconds(Clock::now())},
           {"name", path.name},
           {"carries", carries}});
  };
  callbacks.on_link = [](const r4::LinkStatus& link) {
    const bool active = link.state == r4::HostLinkState::active;
    print({{"type", "link"},
           {"at", seconds(Clock::now())},
           {"active", active},
           {"state", r4::to_text(link.state)},
           {"reason", r4::to_text(link.reason)}});
  };
  r4::Board board(urls, options, callbacks);
  board.wait_active(30s);
  r4::States states = board.states({.lossless = true});
  std::thread telling([&] {
    while (!states.ended()) {
      const auto state = states.take(1s);
      if (state) print({{"type", "state"}, {"at", seconds(state->received)}, {"t", state->t_ms}});
    }
  });
  for (int i = 0; wanted(); ++i) {
    const std::string command =
        "S:" + std::to_string(1000 + i % 1000) + "," + std::to_string(i % 16 + 1);
    Json result{{"type", "command"}, {"command", command}, {"confirmed", true}};
    try {
      board.send(command, 5s);
    } catch (const r4::Error& error) {
      result["confirmed"] = false;
      result["outcome"] = r4::to_text(error.outcome());
      result["error"] = error.what();
    }
    print(result);
  }
  board.close();
  telling.join();
}

}  // namespace

int main(int count, char** arguments) {
  try {
    work({arguments + 1, arguments + count});
  } catch (const r4::Error& error) {
    std::fprintf(stderr, "host_on_paths: %s\n", error.what());
    return 1;
  }
}

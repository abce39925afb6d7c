// SPDX-License-Identifier: GPL-3.0-or-later
// A host with several paths. Each path carries the same datagrams, with its own delay.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "tests/firmware/board_fixture.hpp"

namespace r4::test {

class HostOnPaths {
 public:
  struct Path {
    Source at;
    std::uint32_t lag_ms = 0;
    bool cut = false;
  };

  HostOnPaths(TestBoard& to, std::vector<Path> its_paths)
      : paths(std::move(its_paths)), board_(to) {}

  // Sends on every path that is not cut, and returns the number.
  std::uint32_t send(const std::string& field, std::uint64_t t) {
    const std::uint32_t number = pnum++;
    for (const Path& path : paths) {
      if (path.cut) continue;
      last = with_crc(seal(field + ";" + stamp_of(our_session, number, t)));
      under_way_.push_back({path.at, last, board_.now_ms + path.lag_ms});
    }
    deliver();
    return number;
  }
  std::uint32_t heartbeat() {
    next_heartbeat_ms_ = board_.now_ms + 100;
    return send("H:ROS2-R4", echo());
  }
  std::uint32_t command(const std::string& field) { return send(field, 1699276044383); }

  void connect() {
    heartbeat();
    run(2);
    heartbeat();
    run(250);
  }
  // Advances the time, with a heartbeat every 100 ms.
  void run(std::uint32_t ms) {
    for (std::uint32_t i = 0; i < ms; ++i) {
      board_.run(1);
      deliver();
      if (static_cast<std::int32_t>(board_.now_ms - next_heartbeat_ms_) >= 0) heartbeat();
    }
  }
  // The newest T that arrived on a path that is not cut.
  std::uint32_t echo() {
    std::uint32_t newest = 0;
    for (const Path& path : paths) {
      if (!path.cut) newest = std::max(newest, board_.newest_t(path.at.port));
    }
    return newest;
  }

  std::vector<Path> paths;
  std::uint32_t pnum = 12345;
  std::string last;
  // Changes the fields before they are sent, for example signs them.
  std::function<std::string(const std::string&)> seal = [](const std::string& fields) {
    return fields;
  };

 private:
  struct UnderWay {
    Source at;
    std::string bytes;
    std::uint32_t due_ms;
  };

  void deliver() {
    for (std::size_t i = 0; i < under_way_.size();) {
      const UnderWay next = under_way_[i];
      if (next.due_ms > board_.now_ms) {
        ++i;
        continue;
      }
      under_way_.erase(under_way_.begin() + static_cast<std::ptrdiff_t>(i));
      board_.receive_raw(next.bytes, next.at);
    }
  }

  TestBoard& board_;
  std::vector<UnderWay> under_way_;
  std::uint32_t next_heartbeat_ms_ = 0;
};

}  // namespace r4::test

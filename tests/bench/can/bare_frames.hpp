// SPDX-License-Identifier: GPL-3.0-or-later
// What the frames of ISO-TP cost a program at least: CAN_RAW sockets with nothing above them,
// which exchange as many frames as ISO-TP would, in as few system calls as there are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "can_processes.hpp"

namespace r4::bench {

// Frames that classic ISO-TP cuts a datagram into.
constexpr int frames_of(std::size_t size) {
  return size <= 7 ? 1 : 1 + static_cast<int>((size - 6 + 6) / 7);
}

// How a program waits for a frame: it sleeps, or looks again and again, for which a processor must be
// to spare.
enum class Wait { sleeping, looking };
const char* to_text(Wait wait);

// The end that answers: flow control for a question's first frame, then the answer's frames.
class BareEchoProcess : public ChildProcess {
 public:
  BareEchoProcess(Wait wait, int question_frames, int answer_frames);
};

// Seconds of each of `count` round trips with a BareEchoProcess of the same numbers.
std::vector<double> bare_round_trips(Wait wait, int question_frames, int answer_frames, int count);

// Sends datagrams of so many frames, as many as go; in the dialogue it waits for flow control behind
// the first frame of each. It looks for it.
class BareSenderProcess : public ChildProcess {
 public:
  BareSenderProcess(Lane lane, int frames);
  // Datagrams a second, of `count` that this process takes.
  double rate(std::uint32_t count) const;

 private:
  const Lane lane_;
  const int frames_;
  SharedCount received_;
};

}  // namespace r4::bench

// SPDX-License-Identifier: GPL-3.0-or-later
// The least cost of ISO-TP frames for a program: plain CAN_RAW sockets that exchange as many frames
// as ISO-TP would, in as few system calls as possible.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "can_processes.hpp"

namespace r4::bench {

// The number of frames into which classic ISO-TP splits a datagram.
constexpr int frames_of(std::size_t size) {
  return size <= 7 ? 1 : 1 + static_cast<int>((size - 6 + 6) / 7);
}

// How a program waits for a frame. `sleeping`: in a system call. `looking`: by polling, which needs
// a free processor.
enum class Wait { sleeping, looking };
const char* to_text(Wait wait);

// Answers a question: sends flow control after the question's first frame, then the answer.
class BareEchoProcess : public ChildProcess {
 public:
  BareEchoProcess(Wait wait, int question_frames, int answer_frames);
};

// The duration of each of `count` round trips in seconds. The BareEchoProcess must have the same
// `question_frames` and `answer_frames`.
std::vector<double> bare_round_trips(Wait wait, int question_frames, int answer_frames, int count);

// Sends datagrams of this many frames as fast as possible. In the dialogue the sender polls for
// flow control after the first frame of each datagram.
class BareSenderProcess : public ChildProcess {
 public:
  BareSenderProcess(Lane lane, int frames);
  // Datagrams a second, measured over `count` datagrams that this process receives.
  double rate(std::uint32_t count) const;

 private:
  const Lane lane_;
  const int frames_;
  SharedCount received_;
};

}  // namespace r4::bench

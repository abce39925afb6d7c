// SPDX-License-Identifier: GPL-3.0-or-later
// Counts the datagrams that a receiver joins from two datagrams in streams of telemetry with lost
// frames. Prints the numbers. The same seed gives the same numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>

#include "transports/framing/can/isotp_receiver.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4 {
namespace {

constexpr std::uint32_t frame_us = 130;     // a classic frame at 1 Mbit/s
constexpr std::uint32_t period_us = 10000;  // from one datagram to the next

// The lengths of the datagrams in a stream: random between two limits, and at regular intervals a
// different length.
struct Stream {
  const char* what;
  std::uint32_t shortest, longest;
  std::uint32_t other_every, other;  // 0: no other length
  int datagrams;
};

struct Count {
  int whole = 0;
  int joined = 0;
  int told = 0;  // joined datagrams between whose frames the receiver got a wrong sequence number
};

// A board sends, and a listener receives each frame with a certain probability.
class LossyLine {
 public:
  explicit LossyLine(double loss) : lost_(loss) {}

  Count run(const Stream& stream) {
    std::uniform_int_distribution<std::uint32_t> length(stream.shortest, stream.longest);
    for (int number = 0; number < stream.datagrams; ++number) {
      const bool other = stream.other_every != 0 && number % stream.other_every == 0;
      const std::uint32_t size = other ? stream.other : length(chance_);
      // Each datagram is filled with one byte. The same byte returns after 251 datagrams.
      std::memset(bytes_.data(), number % 251, size);
      send(size, number % 251);
      now_us_ += period_us;
    }
    return count_;
  }

 private:
  static IsotpSenderOptions sending() {
    IsotpSenderOptions options;
    options.flow_control = false;
    return options;
  }
  static IsotpReceiverOptions listening() {
    IsotpReceiverOptions options;
    options.listen_only = true;
    return options;
  }

  void send(std::uint32_t size, int filling) {
    sender_.begin(bytes_.data(), size, now_us_);
    std::uint32_t at_us = now_us_;
    for (CanFrame frame; sender_.offer(at_us, frame); at_us += frame_us) {
      sender_.frame_sent(at_us);
      if (lost_(chance_)) continue;
      const std::uint32_t malformed = receiver_.counters().malformed;
      const bool datagram = receiver_.on_frame(frame, at_us).datagram;
      const bool fits = note(frame, receiver_.counters().malformed != malformed);
      if (!datagram) continue;
      if (is_whole(size, filling)) {
        ++count_.whole;
      } else {
        ++count_.joined;
        count_.told += !fits;
      }
    }
  }

  // True if the frames that arrived since the last first frame count up from it. Frames of an
  // invalid length are ignored (9.6.4.1).
  bool note(const CanFrame& frame, bool passed_over) {
    if (frame.data[0] >> 4 != static_cast<int>(IsotpFrameType::consecutive)) {
      next_ = 1;
      fits_ = true;
    } else if ((frame.data[0] & 0xF) == next_) {
      if (!passed_over) next_ = (next_ + 1) & 0xF;
    } else {
      fits_ = false;
    }
    return fits_;
  }

  bool is_whole(std::uint32_t size, int filling) const {
    const std::uint8_t* const begin = receiver_.data();
    return receiver_.size() == size &&
           std::all_of(begin, begin + size, [filling](std::uint8_t b) { return b == filling; });
  }

  std::mt19937 chance_{12};
  std::bernoulli_distribution lost_;
  std::array<std::uint8_t, 1024> bytes_{}, received_{};
  IsotpSender sender_{sending()};
  IsotpReceiver receiver_{listening(), received_.data(), 1024};
  std::uint32_t now_us_ = 0;
  int next_ = 0;
  bool fits_ = true;
  Count count_;
};

// A wrong sequence number within a datagram is always noticed. If frames over a border are lost,
// the numbers may fit again. The run of lost frames then has the number of frames of a datagram.
// For a longer datagram, the run is 16 (32 …) frames shorter. 18 frames are the worst case, because
// two lost frames are enough.
TEST(IsotpLoss, SeldomJoinsTwoDatagrams) {
  const struct {
    Stream stream;
    std::array<double, 3> most_per_million;  // at 1, 5 and 10 % loss
  } cases[] = {
      {{"25 bytes, 4 frames", 25, 25, 0, 0, 1000000}, {2, 30, 250}},
      {{"8-64 bytes, 2-10 frames", 8, 64, 0, 0, 1000000}, {12, 320, 1200}},
      {{"165-175 bytes, 50th 51: states, 25 frames", 165, 175, 50, 51, 200000}, {0, 0, 10}},
      {{"119-125 bytes, 18 frames", 119, 125, 0, 0, 200000}, {120, 1200, 2000}},
  };
  constexpr std::array<double, 3> losses{0.01, 0.05, 0.1};
  for (const auto& c : cases) {
    for (std::size_t i = 0; i < losses.size(); ++i) {
      const Count count = LossyLine(losses[i]).run(c.stream);
      const double per_million = 1e6 * count.joined / c.stream.datagrams;
      std::printf("%-42s %2.0f %% lost: %4.0f in a million joined, %5.2f %% whole\n", c.stream.what,
                  100 * losses[i], per_million, 100.0 * count.whole / c.stream.datagrams);
      EXPECT_LE(per_million, c.most_per_million[i]) << c.stream.what;
      EXPECT_EQ(count.told, 0) << c.stream.what;
    }
  }
}

}  // namespace
}  // namespace r4

// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of ISO-TP, in memory: a datagram of 170 bytes is split into 25 classic frames and joined
// again. The reference in the same run copies the bytes into and out of the same frames.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <cstring>

#include "tests/bench/measure.hpp"
#include "transports/framing/can/isotp_receiver.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4::bench {
namespace {

constexpr std::uint32_t datagram_size = 170;
constexpr std::size_t frame_count = 25;

struct Ends {
  static IsotpSenderOptions sender_options() {
    IsotpSenderOptions options;
    options.channel.id = 0x400;
    options.flow_control = false;
    return options;
  }
  static IsotpReceiverOptions receiver_options() {
    IsotpReceiverOptions options;
    options.channel.id = 0x400;
    options.listen_only = true;
    return options;
  }

  Ends() { std::memset(datagram, 'x', sizeof datagram); }

  // Splits the datagram into `frames`.
  void cut() {
    benchmark::DoNotOptimize(datagram);
    std::size_t count = 0;
    sender.begin(datagram, sizeof datagram, 0);
    while (sender.offer(0, frames[count])) {
      sender.frame_sent(0);
      ++count;
    }
    if (count != frame_count) std::abort();
  }
  void join() {
    bool complete = false;
    for (const CanFrame& frame : frames) complete |= receiver.on_frame(frame, 0).datagram;
    if (!complete) std::abort();
    benchmark::DoNotOptimize(receiver.data());
  }

  char datagram[datagram_size];
  char buffer[1024];
  CanFrame frames[frame_count + 1] = {};
  IsotpSender sender{sender_options()};
  IsotpReceiver receiver{receiver_options(), buffer, sizeof buffer};
};

void isotp_cut(benchmark::State& bench) {
  Ends ends;
  measure(bench, datagram_size, [&] { ends.cut(); });
}
BENCHMARK(isotp_cut);

void isotp_join(benchmark::State& bench) {
  Ends ends;
  ends.cut();
  measure(bench, datagram_size, [&] { ends.join(); });
}
BENCHMARK(isotp_join);

void isotp_cut_and_join(benchmark::State& bench) {
  Ends ends;
  measure(bench, datagram_size, [&] {
    ends.cut();
    ends.join();
  });
}
BENCHMARK(isotp_cut_and_join);

void isotp_copy(benchmark::State& bench) {
  Ends ends;
  measure(bench, datagram_size, [&] {
    benchmark::DoNotOptimize(ends.datagram);
    for (std::size_t i = 0; i < frame_count - 1; ++i) {
      std::memcpy(ends.frames[i].data + 1, ends.datagram + i * 7, 7);
    }
    benchmark::ClobberMemory();
    for (std::size_t i = 0; i < frame_count - 1; ++i) {
      std::memcpy(ends.buffer + i * 7, ends.frames[i].data + 1, 7);
    }
  });
}
BENCHMARK(isotp_copy);

}  // namespace
}  // namespace r4::bench

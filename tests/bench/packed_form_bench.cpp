// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of packing: the first state of the paper's capture. The reference in the same run copies
// the datagram.
#include <benchmark/benchmark.h>

#include <cstring>

#include "r4link/messages/packed_form.hpp"
#include "tests/bench/measure.hpp"

namespace r4::bench {
namespace {

constexpr Text line(
    "AIN24:24.28;AIN12:12.12;AIN5:5.12;AINDMH:12.11;DMHSTA:1;AINSTEER:1.03;DHB1A:4095,1;"
    "OSMC1:400,1;STEP1POS:-100;SERVO1POS:2000;PNum:7434;T:79090;^0xf07cfd9a^");
constexpr Text command("O:358,1,1;PNum:66;T:1699276044383;^0x7fefae81^");

void pack_datagram(benchmark::State& bench, Text datagram) {
  std::uint8_t bytes[max_datagram];
  if (pack(datagram, bytes, sizeof bytes) == 0) bench.SkipWithError("travels plain");
  measure(bench, datagram.size(), [&] {
    Text text = datagram;
    benchmark::DoNotOptimize(text);
    benchmark::DoNotOptimize(pack(text, bytes, sizeof bytes));
  });
}
BENCHMARK_CAPTURE(pack_datagram, state, line);
BENCHMARK_CAPTURE(pack_datagram, command, command);

void unpack_datagram(benchmark::State& bench, Text datagram) {
  std::uint8_t bytes[max_datagram];
  char out[max_datagram];
  std::size_t size = pack(datagram, bytes, sizeof bytes);
  const UnpackResult result = unpack(bytes, size, out, sizeof out);
  if (!result || Text(out, result.size) != datagram) bench.SkipWithError("not the datagram");
  measure(bench, datagram.size(), [&] {
    benchmark::DoNotOptimize(size);
    benchmark::DoNotOptimize(unpack(bytes, size, out, sizeof out));
  });
}
BENCHMARK_CAPTURE(unpack_datagram, state, line);
BENCHMARK_CAPTURE(unpack_datagram, command, command);

// The reference: each implementation must at least copy the bytes.
void copy_datagram(benchmark::State& bench) {
  char buffer[max_datagram];
  measure(bench, line.size(), [&] {
    Text text = line;
    benchmark::DoNotOptimize(text);
    std::memcpy(buffer, text.data(), text.size());
    benchmark::DoNotOptimize(buffer);
  });
}
BENCHMARK(copy_datagram);

}  // namespace
}  // namespace r4::bench

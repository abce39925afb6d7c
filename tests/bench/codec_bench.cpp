// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of writing and reading a state datagram, the first line of the paper's capture. The
// reference in the same run copies the line's bytes and computes their CRC.
#include <benchmark/benchmark.h>
#include <libdeflate.h>

#include <cstdlib>
#include <cstring>

#include "protocol/datagram/crc32.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/state.hpp"
#include "tests/bench/measure.hpp"

namespace r4::bench {
namespace {

constexpr Text line(
    "AIN24:24.28;AIN12:12.12;AIN5:5.12;AINDMH:12.11;DMHSTA:1;AINSTEER:1.03;DHB1A:4095,1;"
    "OSMC1:400,1;STEP1POS:-100;SERVO1POS:2000;PNum:7434;T:79090;^0xf07cfd9a^");

State state_of_line() {
  Datagram datagram;
  State state;
  if (!read_datagram(line, datagram) || !read_state(datagram, state)) std::abort();
  return state;
}

Text write_state(char* buffer, const State& state) {
  DatagramWriter writer(buffer, max_datagram);
  for (const StateField field : state.present) write_field(writer, field, state);
  return writer.finish(state.pnum, state.t_ms);
}

// The line, opaque to the compiler's optimizer.
Text opaque_line() {
  Text bytes = line;
  benchmark::DoNotOptimize(bytes);
  return bytes;
}

void write_state_datagram(benchmark::State& bench) {
  State state = state_of_line();
  char buffer[max_datagram];
  if (write_state(buffer, state) != line) bench.SkipWithError("not the line of the capture");
  measure(bench, line.size(), [&] {
    benchmark::DoNotOptimize(state);
    benchmark::DoNotOptimize(write_state(buffer, state));
  });
}
BENCHMARK(write_state_datagram);

void read_datagram(benchmark::State& bench) {
  measure(bench, line.size(), [&] {
    Datagram datagram;
    if (!read_datagram(opaque_line(), datagram)) bench.SkipWithError("refused");
    benchmark::DoNotOptimize(datagram);
  });
}
BENCHMARK(read_datagram);

void read_typed_state(benchmark::State& bench) {
  State state;
  measure(bench, line.size(), [&] {
    Datagram datagram;
    if (!read_datagram(opaque_line(), datagram) || !read_state(datagram, state)) {
      bench.SkipWithError("refused");
    }
    benchmark::DoNotOptimize(state);
  });
}
BENCHMARK(read_typed_state);

void crc_table(benchmark::State& bench) {
  measure(bench, line.size(), [] { benchmark::DoNotOptimize(crc32_table(opaque_line())); });
}
BENCHMARK(crc_table);

void crc_fast(benchmark::State& bench) {
  measure(bench, line.size(), [] { benchmark::DoNotOptimize(crc32(opaque_line())); });
}
BENCHMARK(crc_fast);

// The reference: each implementation must at least copy the bytes and check their CRC.
void copy_and_crc(benchmark::State& bench) {
  char buffer[max_datagram];
  measure(bench, line.size(), [&] {
    const Text bytes = opaque_line();
    std::memcpy(buffer, bytes.data(), bytes.size());
    benchmark::DoNotOptimize(libdeflate_crc32(0, buffer, bytes.size()));
  });
}
BENCHMARK(copy_and_crc);

}  // namespace
}  // namespace r4::bench

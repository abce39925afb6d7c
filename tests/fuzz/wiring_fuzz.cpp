// SPDX-License-Identifier: GPL-3.0-or-later
// Wiring files: any text is refused with a reason that a terminal can show, or it is a valid wiring
// that reads equal after it is written again.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "input.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"
#include "r4link/wiring/wiring_value.hpp"

namespace r4 {
namespace {

void look_at(const Wiring& wiring) {
  require(check(wiring).fault == WiringFault::none);
  require(read_wiring(write_wiring(wiring)) == wiring);
}

void look_at(const Problem& problem) {
  require(problem.kind == ErrorKind::data && !problem.reason.empty() && !problem.fix.empty());
  const std::string text = problem.text();
  require(text.size() < 500);
  for (const char c : text) require(static_cast<unsigned char>(c) >= ' ');
}

// Any bytes in place of a wiring have a fault, or can be written.
void look_at_bytes(std::string_view bytes) {
  Wiring wiring = plan_wiring();
  for (std::size_t i = 0; i < bytes.size() && i < signal_count; ++i) {
    wiring.places[i].byte = static_cast<std::uint8_t>(bytes[i]);
  }
  const WiringCheck found = check(wiring);
  if (found.fault == WiringFault::none) return look_at(wiring);
  look_at(problem_of(wiring, found));
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  r4::Wiring wiring;
  if (r4::read_wiring_value(text, wiring) == r4::Refusal::none) r4::look_at(wiring);
  r4::BoardWiring kept;
  if (r4::read_board_wiring(text, kept)) r4::look_at(kept.wiring);
  r4::look_at_bytes(text);
  try {
    r4::look_at(r4::read_wiring(text));
  } catch (const r4::Error& error) {
    r4::look_at(error.problem());
  }
  return 0;
}

// SPDX-License-Identifier: GPL-3.0-or-later
// Events inside the board's application, for a log, a display or a test.
#pragma once

#include <cstdint>

#include "../../protocol/keys/authentication.hpp"
#include "../../protocol/link/board_link.hpp"
#include "../hal.hpp"
#include "r4link/command.hpp"

namespace r4 {
namespace firmware {

enum class BoardState : std::uint8_t { connecting, active, safe };

const char* to_text(BoardState state);

class Observer {
 public:
  virtual void on_state(std::uint32_t t_ms, BoardState state, SafeReason reason) = 0;
  virtual void on_outputs(std::uint32_t t_ms, const Outputs& outputs) = 0;
  virtual void on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command) = 0;
  virtual void on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code) = 0;
  virtual void on_rejected(std::uint32_t t_ms, Verdict verdict) = 0;
  virtual void on_path(std::uint32_t t_ms, Source path, bool joined) {
    static_cast<void>(t_ms);
    static_cast<void>(path);
    static_cast<void>(joined);
  }

 protected:
  ~Observer() = default;
};

}  // namespace firmware
}  // namespace r4

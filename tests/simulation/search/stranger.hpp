// SPDX-License-Identifier: GPL-3.0-or-later
// Somebody who has no key, hears no host and forges no address, but knows all that the board tells
// him: as one who watches, as one of many at a broadcast, and by the answers to what he says
// himself.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace r4::simulation {

class Stranger {
 public:
  static constexpr std::uint32_t address = 0xFFFD;

  // The board has said this to him.
  void hears(std::string_view bytes);

  // The number that the host in control uses next, if he is lucky: he knows one of its numbers that
  // is near. `next`: the true one. Else any number.
  std::uint32_t guess(std::uint32_t next) const;
  // The T of the newest heartbeat; 0: he has heard none.
  std::uint32_t echo() const { return echo_; }
  // The newest cause that the board has named.
  std::int32_t cause() const { return cause_; }
  // What he has to echo for his lease.
  std::uint32_t lease() const { return lease_; }
  // Fields that go in front of what he says, such that he passes for the host.
  const std::string& name() const { return name_; }

 private:
  static constexpr std::uint32_t most_guesses = 4096;
  std::uint32_t echo_ = 0;
  std::uint32_t lease_ = 0;
  std::uint32_t command_ = 0;  // CMD
  std::int32_t cause_ = 0;
  std::string name_;
};

}  // namespace r4::simulation

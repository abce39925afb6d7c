// SPDX-License-Identifier: GPL-3.0-or-later
// Keeps the settings over a restart, as text (settings.hpp) in the core's key-value store on
// partition 3 of the QSPI flash. Has its own thread, because an erase takes 0.1 s or more.
//     loading ---> ready     the store works; load() reads the settings, if there are any
//             ---> absent    partition 3 is missing or does not hold a store
//     avoided                the store ended the last boot, because the core ends the boot
//                            when worn-out flash cannot be erased
//
// Never writes outside partition 3, because partition 1 holds the WiFi firmware. Never writes to a
// partition larger than partition_max, which in older layouts holds the user's files.
#pragma once

#include <atomic>
#include <cstdint>

#include "../../../protocol/messages/settings.hpp"
#include "chip/chip.hpp"
#include "links/hand_over.hpp"

namespace r4 {
namespace giga {

enum class StoreState : std::uint8_t { loading, ready, absent, avoided };

class SettingsStore {
 public:
  static constexpr std::uint64_t partition_max = 2 * 1024 * 1024;

  // Call start() or avoid() once, from the loop.
  void start();
  void avoid() { state_.store(StoreState::avoided, std::memory_order_relaxed); }
  StoreState state() const { return state_.load(std::memory_order_acquire); }
  // Call once. Without stored settings the defaults stay. If the store is loading or avoided, the
  // wiring counts as damaged, and nothing is stored later, to keep the old settings.
  void load(Settings& settings);
  // True if the store may hold settings that load() could not read, such as a node number.
  bool hides_settings() const { return hides_settings_; }
  // Stores `settings` soon, on the thread.
  void keep(const Settings& settings);
  bool keeps() const { return keeps_; }

  std::uint32_t failures() const { return failures_.load(std::memory_order_relaxed); }  // of writes

 private:
  struct Record {
    std::uint16_t size;
    char text[max_settings_text];
  };

  static void run(SettingsStore* store);
  void serve();
  void started(StoreState state);

  static constexpr std::uint32_t stack_size = 8192;

  bool keeps_ = false;
  bool hides_settings_ = false;
  std::atomic<StoreState> state_{StoreState::loading};
  std::atomic<std::uint32_t> failures_{0};
  HandOver<Record> from_store_;
  HandOver<Record> to_store_;

  alignas(8) unsigned char stack_[stack_size];
  rtos::Thread thread_{osPriorityNormal, stack_size, stack_, "r4-settings"};
};

}  // namespace giga
}  // namespace r4

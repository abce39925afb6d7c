// SPDX-License-Identifier: GPL-3.0-or-later
// The settings over a restart: a text (settings.hpp) in the core's key-value store on partition 3 of
// the QSPI flash, by a thread of its own, for an erase takes a tenth of a second and more.
//
//     loading ---> ready     the store is there; the settings, if any were kept, wait in loaded()
//             ---> absent    no partition 3, or one that is not the store's
//     avoided                it has ended the last boot: the core gives up for good where a flash that
//                            is worn out cannot be erased
//
// Nothing is ever written outside that partition (partition 1 holds the WiFi firmware), nor to one
// larger than partition_max: older layouts have a user's files there.
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

  // One of them, once, from the loop.
  void start();
  void avoid() { state_.store(StoreState::avoided, std::memory_order_relaxed); }
  StoreState state() const { return state_.load(std::memory_order_acquire); }
  // What was kept, into `settings`; once, when the state is no longer loading. False: nothing was. Who
  // does not wait that long gets nothing, and nothing will be kept: it would overwrite what was.
  bool loaded(Settings& settings);
  // To be kept, soon.
  void keep(const Settings& settings);
  bool keeps() const { return keeps_; }

  std::uint32_t failures() const {
    return failures_.load(std::memory_order_relaxed);
  }  // of writing

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
  std::atomic<StoreState> state_{StoreState::loading};
  std::atomic<std::uint32_t> failures_{0};
  HandOver<Record> from_store_;
  HandOver<Record> to_store_;

  alignas(8) unsigned char stack_[stack_size];
  rtos::Thread thread_{osPriorityNormal, stack_size, stack_, "r4-settings"};
};

}  // namespace giga
}  // namespace r4

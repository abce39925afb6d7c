// SPDX-License-Identifier: GPL-3.0-or-later
#include "settings_store.hpp"

// clang-format off
#include "chip/chip.hpp"
#include <BlockDevice.h>
#include <MBRBlockDevice.h>
#include <TDBStore.h>
// clang-format on

#include "chip/fault.hpp"

namespace r4 {
namespace giga {

namespace {

constexpr int partition_number = 3;
constexpr const char* key = "r4-settings";
constexpr std::chrono::milliseconds pause(100);
constexpr std::uint16_t unreadable = 0xFFFF;  // size of a record

}  // namespace

void SettingsStore::start() {
  store_is_starting(true);
  thread_.start(mbed::callback(&SettingsStore::run, this));
}

void SettingsStore::started(StoreState state) {
  store_is_starting(false);
  state_.store(state, std::memory_order_release);
}

void SettingsStore::run(SettingsStore* store) { store->serve(); }

void SettingsStore::serve() {
  mbed::BlockDevice* const flash = mbed::BlockDevice::get_default_instance();
  mbed::MBRBlockDevice partition(flash, partition_number);
  mbed::TDBStore store(&partition);
  if (flash == nullptr || partition.init() != mbed::BD_ERROR_OK ||
      partition.size() > partition_max || store.init() != MBED_SUCCESS) {
    started(StoreState::absent);
    return;
  }
  Record record = {};
  std::size_t size = 0;
  const int found = store.get(key, record.text, sizeof record.text, &size);
  if (found != MBED_ERROR_ITEM_NOT_FOUND) {
    record.size = found == MBED_SUCCESS ? static_cast<std::uint16_t>(size) : unreadable;
    from_store_.put(record);
  }
  started(StoreState::ready);
  for (std::uint32_t version = 0;;) {
    if (to_store_.take(version, record)) {
      if (store.set(key, record.text, record.size, 0) != MBED_SUCCESS) ++failures_;
    }
    rtos::ThisThread::sleep_for(pause);
  }
}

void SettingsStore::load(Settings& settings) {
  const StoreState now = state();
  keeps_ = now == StoreState::ready;
  Record record;
  std::uint32_t version = 0;
  const bool has_record = keeps_ && from_store_.take(version, record);
  hides_settings_ = now == StoreState::loading || now == StoreState::avoided ||
                    (has_record && record.size == unreadable);
  if (hides_settings_) settings.site.lose_wiring();
  if (hides_settings_ || !has_record) return;
  read_settings(Text(record.text, record.size), settings);
}

void SettingsStore::keep(const Settings& settings) {
  if (!keeps_) return;
  Record record = {};
  Text text;
  if (!write_settings(settings, record.text, sizeof record.text, text)) return;
  record.size = static_cast<std::uint16_t>(text.size());
  to_store_.put(record);
}

}  // namespace giga
}  // namespace r4

// SPDX-License-Identifier: GPL-3.0-or-later
#include "boot_report.hpp"

#include "../../../protocol/datagram/numbers.hpp"
#include "../../../protocol/messages/message.hpp"
#include "chip/interrupt_stack.hpp"

namespace r4 {
namespace giga {

namespace {

// One line; text beyond its end is cut off.
class LineWriter {
 public:
  explicit LineWriter(char (&out)[BootReport::max_line]) : out_(out) {}
  LineWriter& text(Text text) {
    for (const char c : text) {
      if (size_ < BootReport::max_line) out_[size_++] = c;
    }
    return *this;
  }
  LineWriter& words(const char* words) { return text(Text(words, std::strlen(words))); }
  LineWriter& number(std::uint32_t value) {
    char digits[max_number_text];
    return text(Text(digits, static_cast<std::size_t>(write_number(digits, value) - digits)));
  }
  LineWriter& hundredths(std::uint32_t value) {
    char digits[max_number_text];
    char* const end = write_hundredths(digits, static_cast<std::int32_t>(value));
    return text(Text(digits, static_cast<std::size_t>(end - digits)));
  }
  // At least two digits, as in the paper.
  LineWriter& hex(std::uint32_t value) {
    char digits[max_number_text];
    const char* const end = write_hex(digits, value);
    text(value < 0x10 ? Text("0x0") : Text("0x"));
    return text(Text(digits, static_cast<std::size_t>(end - digits)));
  }
  LineWriter& address(std::uint32_t ip) {
    for (int shift = 24; shift >= 0; shift -= 8) {
      number(ip >> shift & 0xFFU);
      if (shift != 0) text(".");
    }
    return *this;
  }
  Text done() const { return Text(out_, size_); }

 private:
  char* const out_;
  std::size_t size_ = 0;
};

Text fate_of_settings(const SettingsStore& store) {
  if (store.state() == StoreState::absent) {
    return "not kept: no key-value store on QSPI partition 3 (docs/how-to/firmware.md)";
  }
  if (store.state() == StoreState::avoided) {
    return "not kept: the key-value store ended the last boot";
  }
  if (!store.keeps()) return "not kept: the key-value store was not ready in time";
  return store.failures() == 0 ? Text("kept in the key-value store")
                               : Text("not kept: the key-value store cannot be written");
}

Text fate_of_wiring(WiringSource source) {
  switch (source) {
    case WiringSource::plan:
      return "the plan, which nobody has confirmed (r4 wiring confirm serial:auto)";
    case WiringSource::given:
      return "given by its owner";
    case WiringSource::damaged:
      break;
  }
  return "damaged: give it again (r4 wiring give FILE serial:auto)";
}

void write_last_boot(LineWriter& line, const FaultNote& note) {
  line.text("Last boot ended by: ");
  switch (note.kind) {
    case FaultNote::Kind::none:
      line.text("power or reset");
      break;
    case FaultNote::Kind::watchdog:
      line.text("watchdog");
      break;
    case FaultNote::Kind::stack:
      line.text("a full stack of the interrupts");
      break;
    case FaultNote::Kind::fault:
      line.text("fault, exception ").number(note.exception).text(", pc ").hex(note.pc);
      line.text(", status ").hex(note.status);
      break;
  }
}

}  // namespace

Text BootReport::scan(char (&out)[max_line]) {
  const std::uint8_t address = address_++;
  if (sources_.bus->write(address, nullptr, 0) != firmware::I2cResult::ok) return Text();
  LineWriter line(out);
  line.text("i2c device found at address ").hex(address);
  return line.done();
}

Text BootReport::chip(char (&out)[max_line]) {
  static constexpr struct {
    Text part;
    Text function;
  } names[] = {{"PCA9685", "OSMC"},
               {"PCA9685", "DHB12"},
               {"PCA9685", "servos"},
               {"MCP23017", "relays, BLDC direction and brake"},
               {"MCP4728", "BLDC speed"}};
  static_assert(sizeof names / sizeof *names == chip_count, "one for each Chip");
  const auto& name = names[chip_];
  const auto chip = static_cast<Chip>(chip_++);
  const Place address = sources_.hardware->wiring().chip(chip);
  LineWriter line(out);
  line.text(name.part);
  if (address.connected()) line.text(" ").hex(address.number());
  line.text(" (").text(name.function).text("): ");
  const firmware::ChipTrouble trouble = sources_.hardware->trouble(chip);
  if (!address.connected()) {
    line.text("not fitted");
  } else if (trouble == firmware::ChipTrouble::none) {
    line.text("ok");
  } else {
    line.words(to_text(trouble));
  }
  return line.done();
}

Text BootReport::stacks(char (&out)[max_line]) {
  LineWriter line(out);
  const StackUse cores = use_of_core_stack();
  const StackUse own = use_of_own_stack();
  line.text("Interrupt stacks: the core's ").number(cores.most).text(" of ").number(cores.size);
  return line.text(", ours ").number(own.most).text(" of ").number(own.size).done();
}

Text BootReport::keys(char (&out)[max_line]) const {
  const Authentication& authentication = *sources_.authentication;
  if (!authentication.required()) return Text();
  LineWriter line(out);
  line.text("Keys:");
  for (const Key& key : sources_.settings->site.keys) {
    if (key.id != 0) line.text(" ").number(key.id);
  }
  if (authentication.nonce().empty()) {
    return line.text("; no random numbers: only USB is obeyed").done();
  }
  line.text("; dropped:");
  for (int i = static_cast<int>(Verdict::authentic) + 1; i < verdict_count; ++i) {
    const Verdict verdict = static_cast<Verdict>(i);
    line.text(" ").words(to_text(verdict)).text(" ").number(authentication.rejections(verdict));
  }
  return line.done();
}

Text BootReport::paths(char (&out)[max_line]) const {
  const SessionPaths& paths = *sources_.paths;
  if (paths.joins() == 0) return Text();
  LineWriter line(out);
  line.text("Paths: ").number(static_cast<std::uint32_t>(paths.size()));
  return line.text("; joined ").number(paths.joins()).text(", lost ").number(paths.losses()).done();
}

Text BootReport::next(char (&out)[max_line]) {
  LineWriter line(out);
  const Settings& settings = *sources_.settings;
  const std::uint32_t period_ms = 1000U / settings.state_rate_hz;
  const bool up = sources_.network->state() == NetworkState::up;
  switch (step_++) {
    case 1:
      return line.text("R4 Test!").done();
    case 2:
      line.text("Heartbeat Frequency Hz   : ");
      if (1000 % settings.heartbeat_ms == 0)
        return line.number(1000U / settings.heartbeat_ms).done();
      return line.hundredths(100000U / settings.heartbeat_ms).done();
    case 3:
      line.text("TimedheartBeatlimiter    : ").number(settings.heartbeat_ms / period_ms);
      return line.done();
    case 4:
      return line.text("HeartbeatInterval_ms     : ").number(settings.heartbeat_ms).done();
    case 5:
      return line.text("heartbeatIntervalMax     : ").number(settings.timeout_ms).done();
    case 6:
      return line.text("Datagram  Frequency Hz   : ").number(settings.state_rate_hz).done();
    case 7:
      return line.text("datagramInteruptlimiter  : ").number(period_ms).done();
    case 8:
      return line.text("datagramInterval_ms      : ").number(period_ms).done();
    case 9:
      return line.text("Scanning i2c Bus...").done();
    case 10:
      if (address_ < last_address) --step_;
      return scan(out);
    case 11:
      return line.text("Scan Complete").done();
    case 12:
      return line.text("[TISR] Timer Input Freq (Hz) = ").number(sources_.timer_hz).done();
    case 13:
      return line.text("[TISR] Frequency =1000.00, _count = 1000").done();
    case 14:
      return line.text("Started ITimer0 OK").done();
    case 15:
      if (settings.site.network[0] == '\0') return line.text("WiFi: off (C:network,NAME)").done();
      return line.text("Initializing Giga WiFi UDP Client").done();
    case 16:
      return up ? line.address(sources_.network->ip()).done() : Text();
    case 17:
      if (settings.site.network[0] == '\0') return Text();
      line.text(up ? Text("Connected to Wifi: ") : Text("Joining Wifi: "));
      line.words(settings.site.network);
      return line.text(up ? Text(" : WL_CONNECTED") : Text("")).done();
    case 18:
      if (!up) return Text();
      line.text("Starting Wifi UDP - 0 means failed: 1, port ").number(settings.site.udp_port);
      return line.done();
    case 19:
      line.text("CAN: ").number(can_bit_rate / 1000).text(" kbit/s, node ");
      line.number(settings.site.can_node).text(", ");
      line.words(to_text(sources_.can->state()));
      line.text(", errors sent ").number(sources_.can->transmit_errors());
      line.text(", received ").number(sources_.can->receive_errors());
      return line.text(", bus-offs ").number(sources_.can->counters().bus_offs).done();
    case 20:
      chip_ = 0;
      return line.text("Settings: ").text(fate_of_settings(*sources_.store)).done();
    case 21:
      return line.text("Wiring: ").text(fate_of_wiring(settings.site.wiring_source)).done();
    case 22:
      if (chip_ + 1 < chip_count) --step_;
      return chip(out);
    case 23:
      return line.text("Deadlines missed: ").number(sources_.guard->missed()).done();
    case 24:
      return stacks(out);
    case 25:
      return keys(out);
    case 26:
      return paths(out);
    default:
      step_ = 0;
      write_last_boot(line, sources_.last_boot);
      return line.done();
  }
}

}  // namespace giga
}  // namespace r4

// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_program.hpp"

#include "chip/board_clock.hpp"
#include "chip/interrupt_stack.hpp"
#include "chip/true_random.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/config.hpp"

namespace r4 {
namespace giga {

namespace {

// Settings are stored after they have not changed for this time.
constexpr std::uint32_t settle_ms = 1000;

Text board_id() {
  static char text[24];
  const std::uint32_t words[] = {HAL_GetUIDw0(), HAL_GetUIDw1(), HAL_GetUIDw2()};
  char* at = text;
  for (const std::uint32_t word : words) {
    for (int shift = 28; shift >= 0; shift -= 4) *at++ = "0123456789abcdef"[word >> shift & 0xFU];
  }
  return Text(text, sizeof text);
}

firmware::Application::Config config_of(const Settings& settings, Machine& machine) {
  firmware::Application::Config config;
  config.identity.firmware = Text(R4LINK_VERSION);
  config.identity.board_id = board_id();
  config.identity.capabilities = Text("udp+serial+can");
  config.settings = settings;
  machine.add_devices(config);
  static std::uint8_t chance[Authentication::chance_size];
  if (true_random(chance, sizeof chance)) config.chance = chance;
  return config;
}

bool start_can(Fdcan& fdcan, std::uint8_t node) {
  constexpr std::uint32_t rcc_fdcan_on = 1U << 8;
  constexpr std::uint32_t clock_field = 3U << 28;
  constexpr std::uint32_t clock_pll1_q = 1U << 28;
  make_alternate(line_of(can_tx_pin), can_function, LinePull::up);
  make_alternate(line_of(can_rx_pin), can_function, LinePull::up);
  {
    const InterruptLock lock;
    RCC->D2CCIP1R = (RCC->D2CCIP1R & ~clock_field) | clock_pll1_q;
    RCC->APB1HENR |= rcc_fdcan_on;
    static_cast<void>(static_cast<std::uint32_t>(RCC->APB1HENR));
  }
  PLL1_ClocksTypeDef clocks;
  HAL_RCCEx_GetPLL1ClockFreq(&clocks);
  return fdcan.start(can_bit_timing(clocks.PLL1_Q_Frequency, can_bit_rate), emergency_stop_id,
                     command_id(node), watch_id(node));
}

// Used by interrupt handlers. NOLINTBEGIN(cppcoreguidelines-avoid-non-const-global-variables)
Fdcan* interrupting = nullptr;
UsbPort* listening = nullptr;
// NOLINTEND(cppcoreguidelines-avoid-non-const-global-variables)

// Called in an interrupt, so that a stop works even if the loop hangs.
void hear_can() {
  if (interrupting->on_interrupt()) stop_at_once();
  wake_loop();
}
void on_can() { on_own_stack(&hear_can); }

void hear_usb_now() {
  if (listening->take_in()) stop_at_once();
  if (listening->has_received()) wake_loop();
}
void on_usb() { on_own_stack(&hear_usb_now); }

void start_listening(UsbPort& usb) {
  constexpr std::uint32_t gives_way = 13;  // a lower priority than all but the core's scheduler
  listening = &usb;
  NVIC_SetVector(SWPMI1_IRQn, reinterpret_cast<std::uintptr_t>(&on_usb));
  NVIC_SetPriority(SWPMI1_IRQn, gives_way);
  NVIC_EnableIRQ(SWPMI1_IRQn);
  UsbPort::start();
}

// Requests the board's report. Every datagram is longer than this word.
constexpr Text report_word("report");

SafeReason reason_of(const FaultNote& note) {
  switch (note.kind) {
    case FaultNote::Kind::none:
      break;
    case FaultNote::Kind::fault:
    case FaultNote::Kind::stack:
      return SafeReason::fault;
    case FaultNote::Kind::watchdog:
      return SafeReason::watchdog;
  }
  return SafeReason::none;
}

}  // namespace

BoardProgram::BoardProgram(Machine& machine, SettingsStore& store, const Settings& settings,
                           const FaultNote& last_boot)
    : machine_(machine),
      store_(store),
      // NOLINTNEXTLINE(performance-no-int-to-ptr): address of the message RAM
      fdcan_(*FDCAN2, reinterpret_cast<volatile std::uint32_t*>(SRAMCAN_BASE)),
      can_(fdcan_, settings.site.can_node, &BoardClock::now_us),
      application_(machine.hardware(), config_of(settings, machine)),
      report_(report_sources(last_boot)),
      used_(settings),
      kept_(settings),
      last_boot_(reason_of(last_boot)) {}

BootReport::Sources BoardProgram::report_sources(const FaultNote& last_boot) {
  BootReport::Sources sources{};
  sources.settings = &used_;
  sources.bus = &machine_.bus();
  sources.hardware = &machine_.hardware();
  sources.network = &network_;
  sources.can = &fdcan_;
  sources.store = &store_;
  sources.authentication = &application_.authentication();
  sources.paths = &application_.paths();
  sources.guard = &application_.guard();
  sources.last_boot = last_boot;
  sources.timer_hz = timer_input_hz();
  return sources;
}

void BoardProgram::start() {
  static_assert(firmware::Application::max_ports >= 3, "each port has a place");
  usb_number_ = application_.add_port(usb_);
  udp_number_ = application_.add_port(udp_);
  can_number_ = application_.add_port(can_);
  use(used_);
  // With unknown settings the node number may belong to another node.
  const bool has_can = !store_.hides_settings() && start_can(fdcan_, used_.site.can_node);
  const std::uint32_t now_ms = BoardClock::now_ms();
  application_.start(now_ms);
  if (last_boot_ != SafeReason::none) application_.fail(last_boot_, now_ms);
  machine_.start(application_.guard());
  start_guard_timer(application_.guard());
  start_listening(usb_);
  network_.start();
  if (!has_can) return;
  interrupting = &fdcan_;
  NVIC_SetVector(FDCAN2_IT0_IRQn, reinterpret_cast<std::uintptr_t>(&on_can));
  NVIC_EnableIRQ(FDCAN2_IT0_IRQn);
}

void BoardProgram::poll() {
  machine_.poll();
  stay_safe_for_upload();
  hear();
  const std::uint32_t now_ms = BoardClock::now_ms();
  application_.poll(now_ms);
  follow_settings(now_ms);
  tell_report();
  light_.show(application_.state(), application_.reason(), now_ms);
}

// The boot loader does not switch the chips off: the chips would drive outputs after the reset.
void BoardProgram::stay_safe_for_upload() {
  if (usb_.upload_asked()) application_.fail(SafeReason::fault, BoardClock::now_ms());
}

void BoardProgram::receive(std::uint8_t port, std::uint32_t peer, Text datagram) {
  application_.receive(port, peer, datagram, BoardClock::now_ms());
  stay_safe_for_upload();  // the datagram may have been E:CLEAR
}

void BoardProgram::hear() {
  const bool can_lost =
      can_.receive([this](Text datagram) { receive(can_number_, everyone, datagram); });
  if (usb_.begin_turn()) application_.port_down(usb_number_, BoardClock::now_ms());
  usb_.receive([this](Text line) { hear_usb(line); });
  const bool udp_lost = udp_.receive(
      [this](std::uint32_t peer, Text datagram) { receive(udp_number_, peer, datagram); });
  const std::uint32_t now_ms = BoardClock::now_ms();
  if (can_lost) application_.port_down(can_number_, now_ms);
  if (udp_lost) application_.port_down(udp_number_, now_ms);
  if (usb_.poll(now_ms)) application_.port_down(usb_number_, now_ms);
}

void BoardProgram::hear_usb(Text line) {
  if (line == report_word) {
    report_.begin();
    waiting_line_ = Text();
  } else {
    receive(usb_number_, everyone, line);
  }
}

void BoardProgram::tell_report() {
  if (!usb_.open() || (waiting_line_.empty() && !report_.running())) return;
  if (waiting_line_.empty()) waiting_line_ = report_.next(report_line_);
  if (!waiting_line_.empty() && usb_.say(waiting_line_)) waiting_line_ = Text();
}

void BoardProgram::use(const Settings& settings) {
  machine_.hardware().calibrate(settings.site.full_scale_cv);
  network_.use(settings.site);
}

void BoardProgram::follow_settings(std::uint32_t now_ms) {
  const Settings& settings = application_.settings();
  if (settings != used_) {
    const bool elsewhere = !(settings.site == used_.site);
    used_ = settings;
    if (elsewhere) use(used_);
    changed_ = true;
    changed_ms_ = now_ms;
  }
  if (!changed_ || now_ms - changed_ms_ < settle_ms) return;
  changed_ = false;
  if (used_ != kept_) store_.keep(used_);
  kept_ = used_;
}

}  // namespace giga
}  // namespace r4

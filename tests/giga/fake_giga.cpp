// SPDX-License-Identifier: GPL-3.0-or-later
#include "fake_giga.hpp"

#include <algorithm>
#include <csetjmp>
#include <cstdlib>
#include <thread>

#include "core/registers.hpp"

GPIO_TypeDef r4_fake_gpio[11];
I2C_TypeDef r4_fake_i2c2;
I2C_TypeDef r4_fake_i2c4;
USART_TypeDef r4_fake_usart2;
USART_TypeDef r4_fake_uart4;
DAC_TypeDef r4_fake_dac1;
ADC_TypeDef r4_fake_adc1;
FDCAN_GlobalTypeDef r4_fake_fdcan2;
IWDG_TypeDef r4_fake_iwdg1;
TIM_TypeDef r4_fake_tim7;
RCC_TypeDef r4_fake_rcc;
PWR_TypeDef r4_fake_pwr;
RTC_TypeDef r4_fake_rtc;
R4FakeUsb r4_fake_usb;
SCB_Type r4_fake_scb;
std::uint32_t r4_fake_message_ram[2560];

namespace r4::fake {

namespace {

Giga* the_giga = nullptr;
std::jmp_buf reset_point;
bool reset_expected = false;

constexpr std::uint64_t us_ns = 1000;
constexpr std::uint64_t timer_hz = 240000000;
// DIEPCTL of the endpoint: active, bulk, FIFO 1, 64 bytes.
constexpr std::uint32_t usb_active = 1U << 15 | 2U << 18 | 1U << 22 | 64;

void clear_registers() {
  for (GPIO_TypeDef& port : r4_fake_gpio) {
    for (Register* each : {&port.MODER, &port.OTYPER, &port.OSPEEDR, &port.PUPDR, &port.IDR,
                           &port.ODR, &port.BSRR, &port.LCKR, &port.AFR[0], &port.AFR[1]}) {
      each->clear();
    }
    port.MODER.value = 0xFFFFFFFF;
  }
  for (I2C_TypeDef* const i2c : {&r4_fake_i2c2, &r4_fake_i2c4}) {
    auto* const words = reinterpret_cast<Register*>(i2c);
    for (std::size_t i = 0; i < sizeof *i2c / sizeof(Register); ++i) words[i].clear();
  }
  for (USART_TypeDef* const uart : {&r4_fake_usart2, &r4_fake_uart4}) {
    auto* const words = reinterpret_cast<Register*>(uart);
    for (std::size_t i = 0; i < sizeof *uart / sizeof(Register); ++i) words[i].clear();
  }
  auto* const dac = reinterpret_cast<Register*>(&r4_fake_dac1);
  for (std::size_t i = 0; i < sizeof r4_fake_dac1 / sizeof(Register); ++i) dac[i].clear();
  auto* const can = reinterpret_cast<Register*>(&r4_fake_fdcan2);
  for (std::size_t i = 0; i < sizeof r4_fake_fdcan2 / sizeof(Register); ++i) can[i].clear();
  auto* const converter = reinterpret_cast<Register*>(&r4_fake_adc1);
  for (std::size_t i = 0; i < sizeof r4_fake_adc1 / sizeof(Register); ++i) converter[i].clear();
  for (Register* each : {&r4_fake_tim7.CR1, &r4_fake_tim7.DIER, &r4_fake_tim7.SR, &r4_fake_tim7.ARR,
                         &r4_fake_tim7.PSC, &r4_fake_tim7.EGR, &r4_fake_rcc.AHB4ENR,
                         &r4_fake_rcc.APB1LENR, &r4_fake_rcc.APB1HENR, &r4_fake_rcc.APB4ENR,
                         &r4_fake_rcc.D2CCIP1R, &r4_fake_scb.AIRCR, &r4_fake_iwdg1.KR}) {
    each->clear();
  }
}

}  // namespace

Giga& giga() { return *the_giga; }

Giga::Giga(const Wiring& wired) : chips(wired) {
  the_giga = this;
  r4_fake_rtc.BKP20R.clear();
  r4_fake_rcc.RSR.clear();
  r4_fake_rcc.RSR.on_write = [](std::uint32_t value) {
    if ((value & 1U << 16) != 0) r4_fake_rcc.RSR.value = 0;
  };
  chips.power_on();
  for (sim::I2cChipModel* chip : std::initializer_list<sim::I2cChipModel*>{
           &chips.osmc, &chips.dhb12, &chips.servo, &chips.expander, &chips.dac}) {
    chip->follow(now_ns_);
  }
  connect_registers();
}

Giga::~Giga() {
  clear_registers();
  the_giga = nullptr;
}

void Giga::connect_registers() {
  clear_registers();
  for (int i = 0; i < 11; ++i) {
    GPIO_TypeDef& port = r4_fake_gpio[i];
    port.BSRR.on_write = [this, i, &port](std::uint32_t value) {
      const std::uint32_t before = port.ODR.value;
      port.ODR.value = (before & ~(value >> 16)) | (value & 0xFFFF);
      const std::uint32_t risen = port.ODR.value & ~before;
      for (std::size_t line = 0; line < 16; ++line) {
        rises_[static_cast<std::size_t>(i)][line] += static_cast<int>(risen >> line & 1U);
      }
      const bool scl = i == 'H' - 'A' && (port.MODER.value >> 8 & 3U) == 1;  // PH4 as an output
      if (scl && (risen & 1U << 4) != 0) at_bus(0).scl_rose();
      const bool scl1 = i == 'B' - 'A' && (port.MODER.value >> 12 & 3U) == 1;  // PB6
      if (scl1 && (risen & 1U << 6) != 0) at_bus(1).scl_rose();
    };
    port.IDR.on_read = [this, i, &port] {
      std::uint32_t levels = 0;
      for (std::uint32_t line = 0; line < 16; ++line) {
        const std::uint32_t mode = port.MODER.value >> (2 * line) & 3U;
        const std::uint32_t pull = port.PUPDR.value >> (2 * line) & 3U;
        const bool driven = (driven_[static_cast<std::size_t>(i)] >> line & 1U) != 0;
        bool high = mode == 1   ? (port.ODR.value >> line & 1U) != 0
                    : driven    ? (outside_[static_cast<std::size_t>(i)] >> line & 1U) != 0
                    : mode == 2 ? true
                                : pull == 1;
        if (i == 'B' - 'A' && line == 11 && at_bus(0).sda_low()) high = false;
        if (i == 'H' - 'A' && line == 4 && at_bus(0).scl_low()) high = false;
        if (i == 'H' - 'A' && line == 12 && at_bus(1).sda_low()) high = false;
        if (i == 'B' - 'A' && line == 6 && at_bus(1).scl_low()) high = false;
        levels |= (high ? 1U : 0U) << line;
      }
      return levels;
    };
  }
  std::vector<sim::I2cChipModel*> fitted;
  for (int i = 0; i < chip_count; ++i) {
    const Chip chip = static_cast<Chip>(i);
    if (chips.wiring.chip(chip).connected()) fitted.push_back(&chips[chip]);
  }
  const bool first = &at_bus(0) == &i2c;
  i2c.connect(first ? r4_fake_i2c2 : r4_fake_i2c4, std::move(fitted), 2500);
  user_i2c.connect(first ? r4_fake_i2c4 : r4_fake_i2c2, {&devices.mpu6050, &devices.ina219}, 10000);
  uart[0].connect(r4_fake_usart2);
  uart[1].connect(r4_fake_uart4);
  can.connect();
  connect_converter();
  r4_fake_usb.in[1].DIEPCTL.value = usb_active;
  r4_fake_usb.device.DAINTMSK.value = 2;
  r4_fake_usb.global.GRSTCTL.on_write = [this](std::uint32_t value) {
    usb_flushed = usb_flushed || value == (1U << 5 | 1U << 6);
  };
  r4_fake_iwdg1.KR.on_write = [this](std::uint32_t key) {
    if (key == 0xCCCC) watchdog_runs = true;
    if (key == 0xAAAA) ++watchdog_feeds;
    if (key == 0xCCCC || key == 0xAAAA) watchdog_fed_ns = now_ns_;
  };
  r4_fake_tim7.CR1.on_write = [this](std::uint32_t value) {
    step_timer.period_ns =
        (value & 1U) == 0 ? 0 : (r4_fake_tim7.ARR + 1) * 1000000000ULL / timer_hz;
    step_timer.next_ns = now_ns_ + step_timer.period_ns;
    step_timer.action = [this] {
      if (vectors.count(TIM7_IRQn) != 0) vectors[TIM7_IRQn]();
    };
  };
  r4_fake_scb.AIRCR.on_write = [this](std::uint32_t value) {
    if ((value & 0xFFFF0004) == 0x05FA0004) reset();
  };
}

I2cPeripheral& Giga::at_bus(int bus) {
  return chips.wiring.at(SignalKind::chip_bus).number() == bus ? i2c : user_i2c;
}

// ADC1 is ready as soon as it is on. A conversion ends before the firmware reads its state.
void Giga::connect_converter() {
  constexpr std::uint32_t on = 1U << 0;
  constexpr std::uint32_t convert = 1U << 2;
  constexpr std::uint32_t ready = 1U << 0;
  constexpr std::uint32_t converted = 1U << 2;
  ADC_TypeDef& adc = r4_fake_adc1;
  adc.CR.on_write = [this](std::uint32_t value) {
    static const std::map<std::uint32_t, int> pins = {
        {4, 0x24}, {5, 0x11}, {8, 0x25}, {9, 0x10}, {10, 0x20}, {12, 0x22}, {13, 0x23}, {16, 0x00}};
    if (converter_hangs) return;
    const bool was_on = (adc.CR.value & on) != 0;
    adc.CR.value = (adc.CR.value | value) & ~convert;
    if ((value & on) != 0) adc.ISR.value |= ready;
    if ((value & convert) == 0 || !was_on || (adc.ISR.value & ready) == 0) return;
    const std::uint32_t input = adc.SQR1.value >> 6 & 0x1FU;
    const bool selected = (adc.PCSEL.value >> input & 1U) != 0;
    adc.DR.value = selected ? analog[pins.at(input)] : 0;
    adc.ISR.value |= converted;
  };
  adc.ISR.on_write = [](std::uint32_t value) { adc.ISR.value &= ~value; };
  adc.DR.on_read = [] {
    adc.ISR.value &= ~converted;
    return adc.DR.value;
  };
}

void Giga::reset() {
  if (!reset_expected) {
    std::fputs("the chip was reset\n", stderr);
    std::abort();
  }
  std::longjmp(reset_point, 1);
}

bool Giga::reset_by(const std::function<void()>& action) {
  reset_expected = true;
  volatile bool was_reset = true;
  if (setjmp(reset_point) == 0) {
    action();
    was_reset = false;
  }
  reset_expected = false;
  if (was_reset) {
    ticker = Timer();
    step_timer = Timer();
    primask = 0;
    in_interrupt = false;
    core_error = false;
    isr_queue = 0;
    watchdog_runs = false;
    edges.clear();
    vectors.clear();
    priorities.clear();
    for (std::atomic<bool>& line : pending) line = false;
    usb_callbacks.clear();
    connect_registers();
  }
  return was_reset;
}

void Giga::set_pin(char port, int number, bool level) {
  const auto index = static_cast<std::size_t>(port - 'A');
  const std::uint32_t bit = 1U << number;
  driven_[index] |= bit;
  outside_[index] = level ? outside_[index] | bit : outside_[index] & ~bit;
  const auto edge = edges.find(static_cast<int>(index) << 4 | number);
  if (edge != edges.end()) edge->second(level);
}

bool Giga::pin(char port, int number) {
  return (r4_fake_gpio[port - 'A'].ODR.value >> number & 1U) != 0;
}

int Giga::rises(char port, int number) const {
  return rises_[static_cast<std::size_t>(port - 'A')][static_cast<std::size_t>(number)];
}

// If interrupts are on and no interrupt is running, runs the interrupts that are due.
void Giga::interrupts_may_come() {
  // RM0399, IWDG: 32 kHz, divided by 4 << PR, counts from RLR down to 0.
  const std::uint64_t bite_ns = (r4_fake_iwdg1.RLR.value + 1ULL) *
                                (4ULL << r4_fake_iwdg1.PR.value) * 1000000000ULL / 32000ULL;
  if (watchdog_runs && now_ns_ - watchdog_fed_ns > bite_ns) {
    r4_fake_rtc.BKP8R.value = 4;  // as the boot loader does, which clears RCC_RSR
    reset();
  }
  if (primask != 0 || in_interrupt) return;
  for (Timer* timer : {&ticker, &step_timer}) {
    isr_queue = 0;
    while (timer->period_ns != 0 && timer->next_ns <= now_ns_) {  // all late ticks in one interrupt
      timer->next_ns += timer->period_ns;
      in_interrupt = true;
      ++interrupts;
      timer->action();
      in_interrupt = false;
    }
  }
  run_pending();
}

// Runs the interrupts that the firmware has requested, by priority. Here an interrupt does not
// interrupt an interrupt of lower priority.
void Giga::run_pending() {
  for (;;) {
    int next = -1;
    for (const auto& [line, vector] : vectors) {
      if (line < 0 || !pending[static_cast<std::size_t>(line)]) continue;
      if (next < 0 || priorities[line] < priorities[next]) next = line;
    }
    if (next < 0) return;
    pending[static_cast<std::size_t>(next)] = false;
    isr_queue = 0;
    in_interrupt = true;
    ++interrupts;
    vectors[next]();
    in_interrupt = false;
  }
}

void Giga::pass_us(std::uint64_t us) {
  const std::uint64_t end = now_ns_ + us * us_ns;
  while (now_ns_ < end) {
    constexpr std::uint64_t step_ns = 100000;  // one frame on the CAN bus
    std::uint64_t next = std::min(end, now_ns_ + step_ns);
    if (!in_interrupt && primask == 0) {
      for (const Timer* timer : {&ticker, &step_timer}) {
        if (timer->period_ns != 0) next = std::min(next, std::max(timer->next_ns, now_ns_ + 1));
      }
    }
    if (!events_.empty()) next = std::min(next, std::max(events_.begin()->first, now_ns_ + 1));
    now_ns_ = next;
    let_happen();
    can.pass(now_ns_);
    interrupts_may_come();
  }
}

void Giga::let_happen() {
  while (!events_.empty() && events_.begin()->first <= now_ns_) {
    const std::function<void()> event = std::move(events_.begin()->second);
    events_.erase(events_.begin());
    event();
  }
}

bool Giga::usb_endpoint_open() const {
  return (r4_fake_usb.in[1].DIEPCTL.value & usb_active) == usb_active &&
         (r4_fake_usb.device.DAINTMSK.value & 2U) != 0;
}

void Giga::usb_close_under_way() {
  usb_open = false;
  usb_flushed = false;
  r4_fake_usb.in[1].DIEPCTL.value = 0;
  r4_fake_usb.in[1].DIEPINT.value = 0;
  r4_fake_usb.device.DAINTMSK.value = 0;
  r4_fake_usb.device.DIEPEMPMSK.value = 2;
}

void Giga::usb_send(const std::string& bytes) {
  usb_packets.push_back(bytes);
  for (void (*callback)() : usb_callbacks) callback();
}

}  // namespace r4::fake

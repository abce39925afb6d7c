// SPDX-License-Identifier: GPL-3.0-or-later
// The functions of the core that the firmware calls, on a fake Giga.
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <memory>
#include <thread>

#include "core/BlockDevice.h"
#include "core/MBRBlockDevice.h"
#include "core/TDBStore.h"
#include "core/USB/PluggableUSBSerial.h"
#include "core/WiFi.h"
#include "core/hal/trng_api.h"
#include "core/hal/us_ticker_api.h"
#include "core/netsocket/UDPSocket.h"
#undef abs
#undef bit
#undef max
#undef min
#undef round
#undef word

#include "fake_giga.hpp"

namespace {

using r4::fake::Giga;
using r4::fake::giga;

// A thread of the firmware. A stopped thread waits forever at its next sleep, or where it hangs,
// and accesses nothing.
struct FakeThread {
  std::mutex mutex;
  std::condition_variable changed;
  bool end = false;
  bool parked = false;

  void stop() {
    std::unique_lock<std::mutex> lock(mutex);
    end = true;
    changed.notify_all();
    changed.wait(lock, [this] { return parked; });
  }
  void may_end() {
    std::unique_lock<std::mutex> lock(mutex);
    while (end) {
      parked = true;
      changed.notify_all();
      changed.wait(lock);
    }
  }
};
thread_local FakeThread* current = nullptr;

}  // namespace

extern "C" {

std::uint32_t __get_PRIMASK() { return current == nullptr ? giga().primask : 0; }
void __set_PRIMASK(std::uint32_t mask) {
  if (current != nullptr) return;
  giga().primask = mask;
}
void __disable_irq() { __set_PRIMASK(1); }
void __enable_irq() { __set_PRIMASK(0); }
std::uint32_t __get_IPSR() { return 3; }
void __DSB() {}
void NVIC_SetVector(IRQn_Type line, std::uintptr_t vector) {
  giga().vectors[line] = reinterpret_cast<void (*)()>(vector);
}
void NVIC_EnableIRQ(IRQn_Type) {}
void NVIC_SetPriority(IRQn_Type line, std::uint32_t priority) {
  giga().priorities[line] = priority;
}
void NVIC_SetPendingIRQ(IRQn_Type line) { giga().pending[static_cast<std::size_t>(line)] = true; }
std::uint32_t __StackLimit[MBED_CONF_TARGET_BOOT_STACK_SIZE / 4];
std::uintptr_t __get_MSP() {
  return reinterpret_cast<std::uintptr_t>(std::end(__StackLimit)) - Giga::core_stack_in_use;
}

std::uint32_t HAL_RCC_GetPCLK1Freq() { return 120000000; }
std::uint32_t HAL_RCC_GetHCLKFreq() { return 240000000; }
std::uint32_t HAL_RCCEx_GetD3PCLK1Freq() { return 120000000; }
void HAL_RCCEx_GetPLL1ClockFreq(PLL1_ClocksTypeDef* clocks) {
  *clocks = {480000000, 60000000, 240000000};
}
std::uint32_t HAL_GetUIDw0() { return 0x00112233; }
std::uint32_t HAL_GetUIDw1() { return 0x44556677; }
std::uint32_t HAL_GetUIDw2() { return 0x8899aabb; }

osThreadId_t osThreadGetId() { return nullptr; }
std::int32_t osThreadSetPriority(osThreadId_t, osPriority_t) { return 0; }

static void (*error_hook)(const mbed_error_ctx*) = nullptr;
std::int32_t mbed_set_error_hook(void (*hook)(const mbed_error_ctx*)) {
  error_hook = hook;
  return 0;
}
bool mbed_get_error_in_progress() { return giga().core_error; }
void r4_fake_core_warning(std::int32_t status, std::uint32_t address) {
  mbed_error_ctx context = {};
  context.error_status = status;
  context.error_address = address;
  error_hook(&context);
}
void r4_fake_core_error(std::int32_t status, std::uint32_t address) {
  giga().core_error = true;
  r4_fake_core_warning(status, address);
}

std::uint32_t us_ticker_read() {
  if (current == nullptr) giga().pass_us(1);
  return static_cast<std::uint32_t>(giga().now_ns() / 1000);
}
void trng_init(trng_t*) {}
void trng_free(trng_t*) {}
int trng_get_bytes(trng_t*, std::uint8_t* output, std::size_t length, std::size_t* output_length) {
  std::memset(output, 0x5A, length);
  *output_length = length;
  return 0;
}
}

namespace mbed {

InterruptIn::InterruptIn(PinName pin, PinMode mode) : pin_(pin) {
  GPIO_TypeDef& port = r4_fake_gpio[pin >> 4];
  const int line = pin & 0xF;
  port.MODER &= ~(3U << (2 * line));
  port.PUPDR = (port.PUPDR & ~(3U << (2 * line))) | (mode == PullUp     ? 1U
                                                     : mode == PullDown ? 2U
                                                                        : 0U)
                                                        << (2 * line);
  giga().edges[pin] = [this](bool high) {
    const Callback<void()>& action = high ? rise_ : fall_;
    if (!action) return;
    giga().in_interrupt = true;
    giga().isr_queue = 0;
    action();
    giga().in_interrupt = false;
  };
}
InterruptIn::~InterruptIn() { giga().edges.erase(pin_); }
void InterruptIn::rise(Callback<void()> function) { rise_ = function; }
void InterruptIn::fall(Callback<void()> function) { fall_ = function; }

AnalogIn::AnalogIn(PinName pin, float) : pin_(pin) {}
AnalogIn::~AnalogIn() = default;
unsigned short AnalogIn::read_u16() {
  ++giga().core_conversions;
  return giga().analog[pin_];
}

void Ticker::attach(Callback<void()> function, std::chrono::microseconds period) {
  Giga::Timer& timer = giga().ticker;
  timer.period_ns = static_cast<std::uint64_t>(period.count()) * 1000;
  timer.next_ns = giga().now_ns() + timer.period_ns;
  timer.action = [function] { function(); };
}
void Ticker::detach() { giga().ticker.period_ns = 0; }

// --- flash

namespace {
struct Flash final : BlockDevice {
  int init() override { return BD_ERROR_OK; }
  bd_size_t size() const override { return 16 * 1024 * 1024; }
};
}  // namespace
BlockDevice::~BlockDevice() = default;
BlockDevice* BlockDevice::get_default_instance() {
  static Flash flash;
  return &flash;
}
MBRBlockDevice::MBRBlockDevice(BlockDevice* device, int part) : device_(device), part_(part) {}
MBRBlockDevice::~MBRBlockDevice() = default;
int MBRBlockDevice::init() {
  while (giga().flash_hangs) rtos::ThisThread::sleep_for(std::chrono::milliseconds(1));
  return device_ != nullptr && part_ == 3 && giga().has_partition ? BD_ERROR_OK
                                                                  : BD_ERROR_DEVICE_ERROR;
}
bd_size_t MBRBlockDevice::size() const { return giga().partition_size; }
TDBStore::TDBStore(BlockDevice* device) : device_(device) {}
TDBStore::~TDBStore() = default;
int TDBStore::init() { return device_ == nullptr ? -1 : MBED_SUCCESS; }
int TDBStore::set(const char* key, const void* buffer, std::size_t size, std::uint32_t) {
  const std::lock_guard<std::mutex> lock(giga().mutex);
  giga().stored[key] = std::string(static_cast<const char*>(buffer), size);
  ++giga().writes;
  return MBED_SUCCESS;
}
int TDBStore::get(const char* key, void* buffer, std::size_t buffer_size, std::size_t* actual_size,
                  std::size_t) {
  const std::lock_guard<std::mutex> lock(giga().mutex);
  const auto found = giga().stored.find(key);
  if (giga().flash_damaged) return -1;
  if (found == giga().stored.end()) return MBED_ERROR_ITEM_NOT_FOUND;
  *actual_size = std::min(buffer_size, found->second.size());
  std::memcpy(buffer, found->second.data(), *actual_size);
  return MBED_SUCCESS;
}

}  // namespace mbed

namespace rtos {

Thread::Thread(osPriority, std::uint32_t, unsigned char*, const char*) {}
Thread::~Thread() {
  if (running_ != nullptr) static_cast<FakeThread*>(running_)->stop();
}
osStatus Thread::start(mbed::Callback<void()> task) {
  auto* const thread = new FakeThread;  // outlives everything, as its std::thread does
  running_ = thread;
  std::thread([thread, task] {
    current = thread;
    task();
    for (;;) rtos::ThisThread::sleep_for(std::chrono::milliseconds(1));
  }).detach();
  return 0;
}

void ThisThread::sleep_for(Kernel::Clock::duration_u32 time) {
  if (current != nullptr) {
    current->may_end();
    std::this_thread::sleep_for(std::chrono::microseconds(50));
    return;
  }
  giga().pass_ms(time.count());
  // Gives the other threads time, also on a busy machine.
  std::this_thread::sleep_for(std::chrono::microseconds(giga().flash_hangs ? 20 : 1000));
}

std::uint32_t EventFlags::set(std::uint32_t flags) {
  constexpr int isr_queue_size = 16;
  if (giga().in_interrupt && ++giga().isr_queue > isr_queue_size) r4_fake_core_error(-1, 0);
  giga().flag = true;
  return flags;
}
std::uint32_t EventFlags::wait_any_for(std::uint32_t flags, Kernel::Clock::duration_u32 time,
                                       bool) {
  Giga& chip = giga();
  const std::uint64_t end = chip.now_ms() + time.count();
  while (!chip.flag && chip.now_ms() < end) chip.pass_us(25);
  chip.flag = false;
  return flags;
}

}  // namespace rtos

// --- USB

arduino::USBSerial _SerialUSB;
static int usb_locks = 0;
bool USBDevice::configured() { return giga().usb_configured; }
arduino::PluggableUSBDevice& PluggableUSBD() {
  static arduino::PluggableUSBDevice device;
  return device;
}

namespace arduino {

bool USBSerial::connected() { return giga().usb_open; }
std::uint32_t USBSerial::baud() { return giga().usb_baud; }
int USBSerial::available() {
  return giga().usb_packets.empty() ? 0 : static_cast<int>(giga().usb_packets.front().size());
}
void USBSerial::attach(void (*function)()) { giga().usb_callbacks.push_back(function); }
int USBSerial::read() {
  auto& packets = giga().usb_packets;
  if (packets.empty()) return -1;
  const int byte = static_cast<unsigned char>(packets.front().front());
  packets.front().erase(0, 1);
  if (packets.front().empty()) packets.pop_front();
  return byte;
}
void USBCDC::send_nb(std::uint8_t* buffer, std::uint32_t size, std::uint32_t* actual, bool) {
  Giga& chip = giga();
  *actual = 0;
  if (!chip.usb_open || _tx_in_progress) return;
  if (chip.usb_endpoint_open()) {
    if (!chip.usb_reads) return;
    *actual = std::min(size, 64U);
    chip.usb_host.append(reinterpret_cast<const char*>(buffer), *actual);
    chip.usb_sent.push_back({*actual, chip.now_ms()});
  } else {
    *actual = std::min(size, 64U);
    _tx_in_progress = true;  // forever
  }
}
void USBCDC::_change_terminal_connected(bool connected) {
  if (usb_locks == 0) std::abort();  // the core asserts its lock
  if (!connected) _tx_in_progress = false;
}
void PluggableUSBDevice::lock() { ++usb_locks; }
void PluggableUSBDevice::unlock() { --usb_locks; }

// --- WiFi

int WiFiClass::begin(const char*) {
  std::fputs("the core reads a password at address 0\n", stderr);
  std::abort();
}
int WiFiClass::begin(const char* ssid, const char* passphrase, wl_enc_type) {
  for (;;) {
    {
      const std::lock_guard<std::mutex> lock(giga().mutex);
      if (!giga().wifi_hangs) break;
    }
    rtos::ThisThread::sleep_for(std::chrono::milliseconds(1));
  }
  const std::lock_guard<std::mutex> lock(giga().mutex);
  ++giga().joins;
  giga().wifi_connected = giga().air == ssid && giga().air_password == passphrase;
  return giga().wifi_connected ? WL_CONNECTED : WL_CONNECT_FAILED;
}
int WiFiClass::disconnect() {
  const std::lock_guard<std::mutex> lock(giga().mutex);
  giga().wifi_connected = false;
  return 0;
}
std::uint8_t WiFiClass::status() {
  const std::lock_guard<std::mutex> lock(giga().mutex);
  return giga().wifi_connected ? WL_CONNECTED : WL_IDLE_STATUS;
}
IPAddress WiFiClass::localIP() { return IPAddress(192, 168, 0, 162); }

NetworkInterface* WiFiClass::getNetwork() { return nullptr; }

}  // namespace arduino

arduino::WiFiClass WiFi;

UDPSocket::~UDPSocket() = default;
nsapi_error_t UDPSocket::open(NetworkInterface*) { return NSAPI_ERROR_OK; }
nsapi_error_t UDPSocket::bind(std::uint16_t port) {
  const std::lock_guard<std::mutex> lock(giga().mutex);
  giga().udp_port = port;
  return NSAPI_ERROR_OK;
}
void UDPSocket::set_blocking(bool blocking) { blocking_ = blocking; }
nsapi_error_t UDPSocket::close() {
  const std::lock_guard<std::mutex> lock(giga().mutex);
  giga().udp_port = 0;
  return NSAPI_ERROR_OK;
}
nsapi_size_or_error_t UDPSocket::sendto(const SocketAddress& address, const void* data,
                                        unsigned int size) {
  const nsapi_addr_t to = address.get_addr();
  const std::uint32_t ip = std::uint32_t{to.bytes[0]} << 24 | std::uint32_t{to.bytes[1]} << 16 |
                           std::uint32_t{to.bytes[2]} << 8 | to.bytes[3];
  const std::lock_guard<std::mutex> lock(giga().mutex);
  giga().udp_out.push_back(
      {ip, address.get_port(), std::string(static_cast<const char*>(data), size)});
  return static_cast<int>(size);
}
nsapi_size_or_error_t UDPSocket::recvfrom(SocketAddress* address, void* data, unsigned int size) {
  const std::lock_guard<std::mutex> lock(giga().mutex);
  if (giga().udp_in.empty()) {
    if (blocking_) std::abort();  // the call would wait forever
    return NSAPI_ERROR_WOULD_BLOCK;
  }
  const r4::fake::Datagram datagram = giga().udp_in.front();
  giga().udp_in.pop_front();
  nsapi_addr_t from = {};
  from.version = NSAPI_IPv4;
  for (int i = 0; i < 4; ++i)
    from.bytes[i] = static_cast<std::uint8_t>(datagram.ip >> (24 - 8 * i));
  *address = SocketAddress(from, datagram.port);
  const std::size_t count = std::min<std::size_t>(size, datagram.bytes.size());
  std::memcpy(data, datagram.bytes.data(), count);
  return static_cast<int>(count);
}

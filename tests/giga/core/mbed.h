// SPDX-License-Identifier: GPL-3.0-or-later
// What the firmware uses of Mbed OS 6.17: our own declarations with the signatures of the originals.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "registers.hpp"

// Port and number, as in PinNames.h of the STM32 targets.
enum PinName : int {
  PA_0 = 0x00,
  PC_5 = 0x25,
  PK_7 = 0xA7,
};
enum MbedPinMode { PullNone, PullUp, PullDown };

using osStatus = std::int32_t;
enum osPriority_t {
  osPriorityLow = 8,
  osPriorityBelowNormal = 16,
  osPriorityNormal = 24,
  osPriorityAboveNormal = 32
};
using osPriority = osPriority_t;
using osThreadId_t = void*;

struct mbed_error_ctx {
  std::int32_t error_status;
  std::uint32_t error_address;
  std::uint32_t error_value;
};

extern "C" {
osThreadId_t osThreadGetId();
std::int32_t osThreadSetPriority(osThreadId_t thread, osPriority_t priority);
[[noreturn]] void mbed_die();
// A fatal one: not during mbed_warning(), which calls the hook, too.
bool mbed_get_error_in_progress();
std::int32_t mbed_set_error_hook(void (*hook)(const mbed_error_ctx*));
}
#define MBED_SUCCESS 0

namespace mbed {

template <class Signature>
class Callback;
// A function, or a method or function with its object; kept inside, as in the original.
template <>
class Callback<void()> {
 public:
  Callback() = default;
  template <class T>
  Callback(T* object, void (T::*method)()) : object_(object), run_(&run_method<T>) {
    static_assert(sizeof method <= sizeof kept_, "room for it");
    std::memcpy(kept_, &method, sizeof method);
  }
  template <class T>
  Callback(void (*function)(T*), T* object) : object_(object), run_(&run_with_object<T>) {
    std::memcpy(kept_, &function, sizeof function);
  }
  explicit Callback(void (*function)()) : run_(&run_function) {
    std::memcpy(kept_, &function, sizeof function);
  }
  void operator()() const { run_(*this); }
  explicit operator bool() const { return run_ != nullptr; }

 private:
  template <class T>
  static void run_method(const Callback& self) {
    void (T::*method)();
    std::memcpy(&method, self.kept_, sizeof method);
    (static_cast<T*>(self.object_)->*method)();
  }
  template <class T>
  static void run_with_object(const Callback& self) {
    void (*function)(T*);
    std::memcpy(&function, self.kept_, sizeof function);
    function(static_cast<T*>(self.object_));
  }
  static void run_function(const Callback& self) {
    void (*function)();
    std::memcpy(&function, self.kept_, sizeof function);
    function();
  }
  void* object_ = nullptr;
  void (*run_)(const Callback&) = nullptr;
  unsigned char kept_[2 * sizeof(void*)] = {};
};

template <class T>
Callback<void()> callback(T* object, void (T::*method)()) {
  return Callback<void()>(object, method);
}
template <class T>
Callback<void()> callback(void (*function)(T*), T* object) {
  return Callback<void()>(function, object);
}
inline Callback<void()> callback(void (*function)()) { return Callback<void()>(function); }

class NonCopyable {
 public:
  NonCopyable() = default;
  NonCopyable(const NonCopyable&) = delete;
  NonCopyable& operator=(const NonCopyable&) = delete;
};

class InterruptIn : private NonCopyable {
 public:
  InterruptIn(PinName pin, MbedPinMode mode);  // NOLINT
  virtual ~InterruptIn();
  void rise(Callback<void()> function);
  void fall(Callback<void()> function);

 private:
  PinName pin_;
  Callback<void()> rise_;
  Callback<void()> fall_;
};

class AnalogIn : private NonCopyable {
 public:
  AnalogIn(PinName pin, float reference_volts = 3.3F);  // NOLINT
  unsigned short read_u16();

 private:
  PinName pin_;
};

class Ticker : private NonCopyable {
 public:
  Ticker() = default;
  void attach(Callback<void()> function, std::chrono::microseconds period);
  void detach();
};

}  // namespace mbed

namespace rtos {

namespace Kernel {
struct Clock {
  using duration_u32 = std::chrono::duration<std::uint32_t, std::milli>;
};
}  // namespace Kernel

class Thread : private mbed::NonCopyable {
 public:
  Thread(osPriority priority, std::uint32_t stack_size, unsigned char* stack_mem, const char* name);
  virtual ~Thread();
  osStatus start(mbed::Callback<void()> task);

 private:
  void* running_ = nullptr;
};

class EventFlags : private mbed::NonCopyable {
 public:
  EventFlags() = default;
  std::uint32_t set(std::uint32_t flags);
  std::uint32_t wait_any_for(std::uint32_t flags, Kernel::Clock::duration_u32 time,
                             bool clear = true);
};

namespace ThisThread {
void sleep_for(Kernel::Clock::duration_u32 time);
}

}  // namespace rtos

// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of Mbed OS 6.17 that the firmware uses: our own declarations with the signatures of the
// originals.
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
enum PinMode { PullNone, PullUp, PullDown };
struct PinMap {
  PinName pin;
  int peripheral;
  int function;
};

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
  std::uint32_t thread_id;
  std::uint32_t thread_entry_address;
  std::uint32_t thread_stack_size;
  std::uint32_t thread_stack_mem;
  std::uint32_t thread_current_sp;
  char error_filename[16];
  std::uint32_t error_line_number;
};

extern "C" {
osThreadId_t osThreadGetId();
std::int32_t osThreadSetPriority(osThreadId_t thread, osPriority_t priority);
[[noreturn]] void mbed_die();
// True during a fatal error. False during mbed_warning(), which also calls the hook.
bool mbed_get_error_in_progress();
std::int32_t mbed_set_error_hook(void (*hook)(const mbed_error_ctx*));
}
#define MBED_SUCCESS 0
#define MBED_ERROR_ITEM_NOT_FOUND (-2)
#define MBED_CONF_TARGET_BOOT_STACK_SIZE 0x400

namespace mbed {

template <class Signature>
class Callback;
// A function, or a method or function with its object, stored inside as in the original. A Callback
// is not trivial to copy or destroy (MBED_CONF_PLATFORM_CALLBACK_NONTRIVIAL is 1 on the Giga).
template <>
class Callback<void()> {
 public:
  Callback() = default;
  Callback(const Callback& other) { *this = other; }
  Callback& operator=(const Callback& other) {
    object_ = other.object_;
    run_ = other.run_;
    std::memcpy(kept_, other.kept_, sizeof kept_);
    return *this;
  }
  ~Callback() {}  // NOLINT(modernize-use-equals-default): not trivial
  template <class T>
  Callback(T* object, void (T::*method)()) : object_(object), run_(&run_method<T>) {
    static_assert(sizeof method <= sizeof kept_, "room for it");
    std::memcpy(kept_, &method, sizeof method);
  }
  template <class T>
  Callback(void (*function)(T*), T* object) : object_(object), run_(&run_with_object<T>) {
    std::memcpy(kept_, &function, sizeof function);
  }
  Callback(void (*function)()) : run_(&run_function) {  // NOLINT
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

template <class T>
class NonCopyable {
 protected:
  NonCopyable() = default;
  NonCopyable(const NonCopyable&) = delete;
  NonCopyable& operator=(const NonCopyable&) = delete;
};

class InterruptIn : private NonCopyable<InterruptIn> {
 public:
  InterruptIn(PinName pin);                // NOLINT
  InterruptIn(PinName pin, PinMode mode);  // NOLINT
  virtual ~InterruptIn();
  void rise(Callback<void()> function);
  void fall(Callback<void()> function);

 private:
  PinName pin_;
  Callback<void()> rise_;
  Callback<void()> fall_;
};

class AnalogIn {
 public:
  AnalogIn(const PinMap& pinmap, float reference_volts = 3.3F);  // NOLINT
  AnalogIn(const PinMap&&, float reference_volts = 3.3F) = delete;
  AnalogIn(PinName pin, float reference_volts = 3.3F);  // NOLINT
  virtual ~AnalogIn();
  unsigned short read_u16();

 private:
  PinName pin_;
};

class Ticker : private NonCopyable<Ticker> {
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

class Thread : private mbed::NonCopyable<Thread> {
 public:
  Thread(osPriority priority = osPriorityNormal, std::uint32_t stack_size = 4096,  // NOLINT
         unsigned char* stack_mem = nullptr, const char* name = nullptr);
  Thread(std::uint32_t tz_module, osPriority priority = osPriorityNormal,  // NOLINT
         std::uint32_t stack_size = 4096, unsigned char* stack_mem = nullptr,
         const char* name = nullptr);
  virtual ~Thread();
  osStatus start(mbed::Callback<void()> task);

 private:
  void* running_ = nullptr;
};

class EventFlags : private mbed::NonCopyable<EventFlags> {
 public:
  EventFlags() = default;
  EventFlags(const char* name);  // NOLINT
  std::uint32_t set(std::uint32_t flags);
  std::uint32_t wait_any_for(std::uint32_t flags, Kernel::Clock::duration_u32 time,
                             bool clear = true);
};

namespace ThisThread {
[[deprecated]] void sleep_for(std::uint32_t millisec);
void sleep_for(Kernel::Clock::duration_u32 time);
}  // namespace ThisThread

}  // namespace rtos

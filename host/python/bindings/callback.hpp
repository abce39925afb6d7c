// SPDX-License-Identifier: GPL-3.0-or-later
// A Python function that another thread calls.
#pragma once

#include <memory>
#include <utility>

#include "bindings.hpp"

namespace r4::python {

// True if no other thread can get the GIL. Then Python objects must not be destroyed.
inline bool interpreter_ends() {
#if PY_VERSION_HEX >= 0x030D0000
  return Py_IsInitialized() == 0 || Py_IsFinalizing() != 0;
#else
  return Py_IsInitialized() == 0 || _Py_IsFinalizing() != 0;
#endif
}

// A foreign thread's state, kept until the thread ends, because a state for each call costs more.
class KeptThreadState {
 public:
  KeptThreadState() = default;
  KeptThreadState(const KeptThreadState&) = delete;
  KeptThreadState& operator=(const KeptThreadState&) = delete;
  ~KeptThreadState() {
    if (!kept_) return;
    if (interpreter_ends()) {
      static_cast<void>(kept_.release());
      return;
    }
    const py::gil_scoped_acquire gil;
    kept_.reset();
  }
  // Call of_this_thread() with the GIL.
  static void of_this_thread() {
    static thread_local KeptThreadState state;
    if (!state.kept_) state.kept_ = std::make_unique<py::gil_scoped_acquire>();
  }

 private:
  std::unique_ptr<py::gil_scoped_acquire> kept_;
};

// Any thread may copy, call and destroy a Callback. sys.unraisablehook reports its exceptions.
class Callback {
 public:
  struct Held {
    py::object function;  // null after clear() by the garbage collector
  };

  explicit Callback(py::object function)
      : held_(new Held{std::move(function)}, [](Held* held) {
          if (interpreter_ends()) return;
          const py::gil_scoped_acquire gil;
          delete held;
        }) {}

  const std::shared_ptr<Held>& held() const { return held_; }

  template <class... Arguments>
  void operator()(const Arguments&... arguments) const {
    const py::gil_scoped_acquire gil;
    KeptThreadState::of_this_thread();
    const py::object function = held_->function;
    if (!function || function.is_none()) return;
    try {
      function(arguments...);
    } catch (py::error_already_set& error) {
      error.discard_as_unraisable(function);
    }
  }

 private:
  std::shared_ptr<Held> held_;
};

}  // namespace r4::python

// SPDX-License-Identifier: GPL-3.0-or-later
// A value that belongs to one process. A forked child must not use the value. In the child its
// threads are missing, its locks may be held for ever, and its path belongs to the parent.
#pragma once

#include <unistd.h>

#include <memory>
#include <string>
#include <utility>

#include "bindings.hpp"
#include "r4link/recording.hpp"

namespace r4::python {

template <class Value>
class OfThisProcess {
 public:
  // `what`: the value's name in errors, "the board".
  OfThisProcess(const char* what, std::unique_ptr<Value> value)
      : what_(what), value_(std::move(value)) {}
  OfThisProcess(OfThisProcess&&) noexcept = default;
  OfThisProcess& operator=(OfThisProcess&&) = delete;
  // Needs the GIL, which is released while the value is destroyed.
  ~OfThisProcess() {
    if (!value_) return;
    if (!is_here()) {
      static_cast<void>(value_.release());
      return;
    }
    const py::gil_scoped_release free;
    value_.reset();
  }

  bool is_here() const { return ::getpid() == process_; }
  // Throws Error in a fork.
  Value& get() const {
    if (is_here()) return *value_;
    throw Error(Problem{ErrorKind::refused, what_,
                        "the process " + std::to_string(process_) +
                            " opened it, and this process is a fork of that process",
                        "open the object in this process, after the fork", Outcome::closed});
  }
  Value* operator->() const { return &get(); }
  Value& operator*() const { return get(); }
  // Does nothing in a fork.
  template <class Action>
  void if_here(Action action) const {
    if (is_here()) action(*value_);
  }

 private:
  const char* what_;
  pid_t process_ = ::getpid();
  std::unique_ptr<Value> value_;
};

using PyRecording = OfThisProcess<Recording>;

}  // namespace r4::python

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../bindings.hpp"
#include "../callback.hpp"
#include "../process.hpp"
#include "r4link/simulation.hpp"

namespace r4::python {

using Ms = std::chrono::milliseconds;
using Released = py::call_guard<py::gil_scoped_release>;

class PyBoard {
 public:
  // `link`: the faults of its link (sim::with_link()), or "". `transports`: used instead of `url`.
  PyBoard(const std::string& url, const std::vector<CarrierMaker>& transports,
          const std::string& link, BoardOptions options) {
    options.on_wait = on_wait;
    const py::gil_scoped_release free;
    if (!transports.empty()) {
      board_.emplace("the board", std::make_unique<Board>(transports, std::move(options)));
      return;
    }
    board_.emplace("the board", link.empty() ? std::make_unique<Board>(url, std::move(options))
                                             : std::make_unique<Board>(sim::with_link(url, link),
                                                                       std::move(options)));
  }
  PyBoard(const PyBoard&) = delete;
  PyBoard& operator=(const PyBoard&) = delete;
  ~PyBoard() = default;

  Board* operator->() { return &board_->get(); }

  // Call close() without the GIL.
  void close() {
    board_->if_here([this](Board& board) {
      board.close();
      const py::gil_scoped_acquire gil;
      clear();  // the callbacks may refer to this board
    });
  }

  // If Python has a pending signal, throws its exception, which ends the call that waits.
  static void on_wait() {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  }
  template <class Action>
  void if_here(Action action) const {
    board_->if_here(action);
  }

  template <class Subscribe>
  Subscription subscribe(py::object function, Subscribe to) {
    const Callback callback(std::move(function));
    std::erase_if(callbacks_, [](const auto& each) { return each.expired(); });
    callbacks_.push_back(callback.held());
    const py::gil_scoped_release free;
    return to(callback);
  }

  // For the garbage collector: Python functions that refer to the board form cycles.
  int traverse(visitproc visit, void* arg) const {
    for (const auto& each : callbacks_) {
      if (const auto held = each.lock()) Py_VISIT(held->function.ptr());
    }
    return 0;
  }
  void clear() {
    for (const auto& each : callbacks_) {
      if (const auto held = each.lock()) held->function = py::none();
    }
  }

 private:
  std::vector<std::weak_ptr<Callback::Held>> callbacks_;  // guarded by the GIL
  std::optional<OfThisProcess<Board>> board_;  // destroyed first: its threads use the other members
};

}  // namespace r4::python

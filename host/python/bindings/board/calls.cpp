// SPDX-License-Identifier: GPL-3.0-or-later
// The calls of r4link.aio.Board. The loop never needs the GIL, and no thread waits for a call.
//     the thread of Python            the board's loop
//     Calls.arm(…) ---- posted ---->  AsyncBoard::async_arm()
//     Call, whose descriptor  <-----  its handler
//     becomes readable
#include <sys/eventfd.h>
#include <unistd.h>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/cancellation_signal.hpp>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <exception>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>

#include "py_board.hpp"
#include "r4link/async_board.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4::python {
namespace {

using Value = std::variant<std::monostate, BoardIdentity, BoardWiring, I2cAnswer>;

class Call {
 public:
  explicit Call(PyBoard& board) : board_(board) {
    if (news_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  ~Call() { ::close(news_); }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  // Call end_with() on the loop, or before the call is posted. `end` returns the value, or throws.
  template <class End>
  void end_with(End end) {
    try {
      value_ = end();
    } catch (...) {
      error_ = std::current_exception();
    }
    ended_ = true;
    static_cast<void>(::eventfd_write(news_, 1));
  }
  asio::cancellation_signal& cancelled() { return cancelled_; }

  int fileno() const { return news_; }
  // Does nothing after the end, and in a fork.
  static void cancel(const std::shared_ptr<Call>& self) {
    if (self->ended_) return;
    self->board_.if_here([&](Board& board) {
      board.post_to_loop(
          [self](AsyncBoard&) { self->cancelled_.emit(asio::cancellation_type::terminal); });
    });
  }
  // Call result() only after the end.
  py::object result() const {
    if (error_) std::rethrow_exception(error_);
    if (const auto* identity = std::get_if<BoardIdentity>(&value_)) return py::cast(*identity);
    if (const auto* wiring = std::get_if<BoardWiring>(&value_)) return py::cast(*wiring);
    if (const auto* answer = std::get_if<I2cAnswer>(&value_)) {
      return py::bytes(reinterpret_cast<const char*>(answer->data.bytes), answer->data.size);
    }
    return py::none();
  }

 private:
  PyBoard& board_;  // Python keeps it alive as long as this object
  const int news_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::atomic<bool> ended_{false};  // publishes the result
  std::exception_ptr error_;
  Value value_;
  asio::cancellation_signal cancelled_;  // on the loop
};
using CallPtr = std::shared_ptr<Call>;

std::string name_of(const std::string& request) { return request; }
template <class Request>
std::string name_of(const Request& request) {
  return shown(request);
}

constexpr auto confirmed = [](const auto& request, const AsyncBoard& board,
                              const CommandResult& result) {
  if (result.outcome != Outcome::confirmed) throw Error(explain(request, result, board.link()));
  return Value();
};

class Calls {
 public:
  explicit Calls(PyBoard& board) : board_(board) {}

  // `start(board, handler)` begins the call on the loop. `end(request, board, result)` returns the
  // call's value, or throws. The request names the call in errors.
  template <class Request, class Start, class End = decltype(confirmed)>
  CallPtr begin(Request request, Start start, End end = confirmed) {
    auto call = std::make_shared<Call>(board_);
    const auto action = [call, request, start, end](AsyncBoard& board) {
      auto handler = [call, request, end, &board](const CommandResult& result) {
        call->end_with([&] { return end(request, board, result); });
      };
      try {
        start(board, asio::bind_cancellation_slot(call->cancelled().slot(), std::move(handler)));
      } catch (const Error& error) {
        call->end_with([&]() -> Value {
          Problem problem = error.problem();
          if (!problem.thing.starts_with("async_")) throw;
          problem.thing = name_of(request);
          throw Error(std::move(problem));
        });
      }
    };
    if (!board_->post_to_loop(action)) {
      call->end_with(
          [&]() -> Value { throw Error(explain(request, {Outcome::closed}, board_->link())); });
    }
    return call;
  }

  CallPtr send(const CommandOrGroup& what, int ms) {
    return std::visit(
        [&](const auto& each) {
          return begin(each, [each, ms](AsyncBoard& board, auto handler) {
            board.async_send(each, Ms(ms), std::move(handler));
          });
        },
        what);
  }
  CallPtr stop(int ms) { return send(OwnCommand(Command::stop()), ms); }
  CallPtr arm(int ms) {
    return begin(std::string("arm()"), [ms](AsyncBoard& board, auto handler) {
      board.async_arm(Ms(ms), std::move(handler));
    });
  }
  template <class Answer>
  CallPtr ask(const Command& question, int ms, Answer answer) {
    return begin(
        OwnCommand(question),
        [question, ms](AsyncBoard& board, auto handler) {
          board.async_send(question, Ms(ms), std::move(handler));
        },
        [answer](const OwnCommand& command, const AsyncBoard& board, const CommandResult& result) {
          confirmed(command, board, result);
          return Value(answer(board));
        });
  }
  CallPtr identify(int ms) {
    return ask(Command::identify(), ms, [](const AsyncBoard& board) { return board.identity(); });
  }
  CallPtr wiring(int ms) {
    return ask(Command::ask_wiring(), ms,
               [](const AsyncBoard& board) { return board.identity().wiring.value(); });
  }
  CallPtr transfer(std::string_view text, int ms) {
    const OwnCommand command = parse_command_text(text);
    return begin(
        command,
        [command, ms](AsyncBoard& board, auto handler) {
          board.async_transfer(command, Ms(ms), std::move(handler));
        },
        [](const OwnCommand& asked, const AsyncBoard& board, const CommandResult& result) {
          confirmed(asked, board, result);
          return Value(result.transfer);
        });
  }
  CallPtr attach(const Device& device, int ms) {
    return begin(
        device.text(),
        [device, ms](AsyncBoard& board, auto handler) {
          board.async_attach(device, Ms(ms), std::move(handler));
        },
        [device](const std::string&, const AsyncBoard& board, const CommandResult& result) {
          if (result.outcome == Outcome::confirmed) return Value();
          throw Error(explain(device, result, board.link()));
        });
  }
  CallPtr link_timing(int timeout, int heartbeat, int ms) {
    return begin(std::string("link_timing()"), [=](AsyncBoard& board, auto handler) {
      board.async_link_timing(Ms(timeout), Ms(heartbeat), Ms(ms), std::move(handler));
    });
  }
  CallPtr wait_active(int ms) {
    return begin(
        std::string("wait_active()"),
        [ms](AsyncBoard& board, auto handler) {
          board.async_wait_active(Ms(ms), std::move(handler));
        },
        [](const std::string& text, const AsyncBoard& board, const CommandResult& result) {
          if (result.outcome == Outcome::refused) throw Error(explain(board.paths()));
          if (result.outcome == Outcome::timed_out)
            throw Error(explain(board.name(), board.link()));
          return confirmed(text, board, result);
        });
  }
  CallPtr take_control() {
    return begin(std::string("take_control()"), [](AsyncBoard& board, auto handler) {
      board.take_control();
      std::move(handler)(CommandResult{Outcome::confirmed});
    });
  }
  CallPtr release_control(int ms) {
    return begin(
        std::string("release_control()"),
        [ms](AsyncBoard& board, auto handler) {
          board.async_release_control(Ms(ms), std::move(handler));
        },
        [](const std::string& text, const AsyncBoard& board, const CommandResult& result) {
          const bool was_ours =
              result.outcome != Outcome::none && result.outcome != Outcome::refused;
          return was_ours ? confirmed(text, board, result) : Value();
        });
  }

 private:
  PyBoard& board_;  // Python keeps it alive as long as this object
};

}  // namespace

void bind_calls(py::module_& module) {
  py::class_<Call, CallPtr>(module, "Call")
      .def("fileno", &Call::fileno)
      .def("cancel", &Call::cancel, Released())
      .def("result", &Call::result);

  using Keep = py::keep_alive<0, 1>;  // a call keeps its board alive
  py::class_<Calls>(module, "Calls")
      .def(py::init<PyBoard&>(), py::keep_alive<1, 2>())
      .def(
          "send",
          [](Calls& calls, std::string_view text, int ms) {
            return calls.send(parse_text(text), ms);
          },
          Keep(), Released())
      .def(
          "send",
          [](Calls& calls, const OwnCommand& command, int ms) { return calls.send(command, ms); },
          Keep(), Released())
      .def(
          "send",
          [](Calls& calls, const Setpoints& group, int ms) { return calls.send(group, ms); },
          Keep(), Released())
      .def("stop", &Calls::stop, Keep(), Released())
      .def("arm", &Calls::arm, Keep(), Released())
      .def("identify", &Calls::identify, Keep(), Released())
      .def("wiring", &Calls::wiring, Keep(), Released())
      .def("transfer", &Calls::transfer, Keep(), Released())
      .def("attach", &Calls::attach, Keep(), Released())
      .def("link_timing", &Calls::link_timing, Keep(), Released())
      .def("wait_active", &Calls::wait_active, Keep(), Released())
      .def("take_control", &Calls::take_control, Keep(), Released())
      .def("release_control", &Calls::release_control, Keep(), Released());
}

}  // namespace r4::python

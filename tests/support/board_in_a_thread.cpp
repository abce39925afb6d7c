// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_in_a_thread.hpp"

#include <fcntl.h>

#include <asio/executor_work_guard.hpp>
#include <asio/post.hpp>
#include <future>

#include "r4link/commands/command_text.hpp"
#include "transports/registry.hpp"

namespace r4::test {

BoardInAThread::BoardInAThread(const std::vector<std::string>& transports,
                               const std::string& script, const std::string& board_id) {
  sim::SimulatedBoard::Options options;
  options.board_id = board_id;
  options.script = sim::Script::parse(script, "script");
  options.events.on_executed = [this](std::uint32_t, std::uint32_t, const Command& command) {
    const std::lock_guard lock(mutex_);
    executed_.push_back(to_text(command));
  };
  options.events.on_state = [this](std::uint32_t, firmware::BoardState state, SafeReason reason) {
    {
      const std::lock_guard lock(mutex_);
      state_ = state;
      reason_ = reason;
    }
    changed_.notify_all();
  };
  board_ = std::make_unique<sim::SimulatedBoard>(io_, std::move(options));
  std::vector<const Carrier*> listening;
  for (const std::string& transport : transports) {
    const std::string url = transport == "udp"   ? "udp://127.0.0.1:0"
                            : transport == "pty" ? "pty:"
                                                 : transport;
    std::unique_ptr<Carrier> carrier = Registry::standard().make(io_, url, Role::board);
    listening.push_back(carrier.get());
    board_->add_carrier(std::move(carrier));
  }
  board_->start();
  for (std::size_t i = 0; i < transports.size(); ++i) {
    const std::string& name = listening[i]->name();  // "udp://127.0.0.1:40123", "pty:/dev/pts/5"
    urls_.push_back(transports[i] == "udp"   ? name + "?listen=0"
                    : transports[i] == "pty" ? "serial://" + name.substr(name.find(':') + 1)
                                             : transports[i]);
  }
  thread_ = std::thread([this] {
    const auto work = asio::make_work_guard(io_);
    io_.run();
  });
}

BoardInAThread::~BoardInAThread() { switch_off(); }

// The system reuses the number of a pty when all programs have closed it. A host that waits for
// this board would then find the board of another test.
void BoardInAThread::switch_off() {
  if (!thread_.joinable()) return;
  for (const std::string& url : urls_) {
    const std::string scheme = "serial://";
    if (!url.starts_with(scheme)) continue;
    ptys_.emplace_back(
        ::open(url.c_str() + scheme.size(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  }
  run([](sim::SimulatedBoard& board) { board.stop(); });
  io_.stop();
  thread_.join();
}

void BoardInAThread::run(const std::function<void(sim::SimulatedBoard&)>& action) {
  std::promise<void> done;
  asio::post(io_, [&] {
    action(*board_);
    done.set_value();
  });
  done.get_future().get();
}

bool BoardInAThread::is_without_host() {
  bool safe = false;
  run([&](sim::SimulatedBoard& each) {
    safe = each.application().reason() == SafeReason::link &&
           each.application().outputs().osmc[0].pwm == 0;
  });
  return safe;
}

std::vector<std::string> BoardInAThread::executed() {
  const std::lock_guard lock(mutex_);
  return executed_;
}

bool BoardInAThread::wait_for(firmware::BoardState state, SafeReason reason) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::seconds{5},
                           [&] { return state_ == state && reason_ == reason; });
}

bool hears_of(const Board& host, SafeReason reason) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::seconds{5};
  while (host.link().reason != reason && Clock::now() < end) std::this_thread::yield();
  return host.link().reason == reason;
}

}  // namespace r4::test

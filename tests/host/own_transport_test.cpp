// SPDX-License-Identifier: GPL-3.0-or-later
// The transport of docs/examples/own_transport between a Board and a simulated board.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <memory>
#include <string>
#include <thread>

#include "docs/examples/own_transport/socket_carrier.hpp"
#include "firmware/ports/sim/simulated_board.hpp"
#include "host/board_loop.hpp"
#include "r4link/board.hpp"
#include "tests/support/at_will.hpp"
#include "tests/support/first.hpp"
#include "transports/file_descriptor.hpp"

namespace r4::test {
namespace {

class BoardBehindASocket {
 public:
  BoardBehindASocket() {
    int ends[2];
    EXPECT_EQ(0, ::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends));
    here_.reset(ends[0]);
    there_.reset(ends[1]);
    board_ = std::make_unique<sim::SimulatedBoard>(io_, sim::SimulatedBoard::Options());
    board_->add_carrier(std::make_unique<SocketCarrier>(loop_, there_.get()));
    board_->start();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~BoardBehindASocket() { switch_off(); }
  BoardBehindASocket(const BoardBehindASocket&) = delete;
  BoardBehindASocket& operator=(const BoardBehindASocket&) = delete;

  CarrierMaker host_end() {
    return [this](Loop& loop) { return std::make_unique<SocketCarrier>(loop, here_.get()); };
  }
  void switch_off() {
    if (!thread_.joinable()) return;
    asio::post(io_, [this] {
      board_.reset();
      work_.reset();
    });
    thread_.join();
  }

 private:
  FileDescriptor here_;
  FileDescriptor there_;
  asio::io_context io_;
  asio::executor_work_guard<asio::io_context::executor_type> work_ = asio::make_work_guard(io_);
  BoardLoop loop_{io_};
  std::unique_ptr<sim::SimulatedBoard> board_;
  std::thread thread_;
};

TEST(OwnTransport, CarriesCommandsAndStopsToABoard) {
  BoardBehindASocket simulated;
  Board board(simulated.host_end(), at_will());
  board.wait_active();
  EXPECT_EQ(board.name(), "radio");
  EXPECT_NO_THROW(board.send("O:358,1,1"));
  EXPECT_NO_THROW(board.stop());
}

TEST(OwnTransport, IsDownWhenTheOtherProgramCloses) {
  BoardBehindASocket simulated;
  const First<std::string> down;
  BoardCallbacks callbacks;
  callbacks.on_event = [down](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::down) down.set(event.problem.reason);
  };
  Board board(simulated.host_end(), at_will(), callbacks);
  board.wait_active();
  simulated.switch_off();
  EXPECT_EQ(down.get(), "the other end was closed");
}

}  // namespace
}  // namespace r4::test

// SPDX-License-Identifier: GPL-3.0-or-later
// Boards on the loopback that answer every datagram, each board at a different address and all
// boards at one port. The boards run in a thread, because a search blocks.
#pragma once

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/udp.hpp>
#include <asio/post.hpp>
#include <cstdint>
#include <future>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "tests/support/datagrams.hpp"
#include "transports/udp/search/board_search.hpp"

namespace r4::test {

// The answer of a board. `more` is for example "NAME:left;BUSY:0;".
inline std::string identity(const std::string& id, const std::string& more = "") {
  return with_crc("I:R4,0.1.0," + id + ",udp;" + more + "PNum:1;T:2;");
}

class AnsweringBoards {
 public:
  using Answers = std::vector<std::string>;

  AnsweringBoards() : thread_([this] { io_.run(); }) {}
  ~AnsweringBoards() {
    io_.stop();
    thread_.join();
  }
  AnsweringBoards(const AnsweringBoards&) = delete;
  AnsweringBoards& operator=(const AnsweringBoards&) = delete;

  // Adds a board at 127.0.<address>, such as "0.2", or replaces the board at this address. The
  // board answers each question from number `first` on with all `answers`.
  void add(const std::string& address, Answers answers, int first = 1) {
    on_thread([&] {
      boards_.erase(address);
      const asio::ip::udp::endpoint at(asio::ip::make_address("127.0." + address), port_);
      auto board = std::make_unique<One>(io_, at);
      board->answers = std::move(answers);
      board->first = first;
      port_ = board->socket.local_endpoint().port();
      receive(*board);
      boards_[address] = std::move(board);
    });
  }
  // Answers from another port of the address before the board answers.
  void add_elsewhere(const std::string& address, const std::string& answer) {
    on_thread([&] {
      boards_.at(address)->elsewhere = answer;
      boards_.at(address)->other.bind({asio::ip::make_address("127.0." + address), 0});
    });
  }
  void remove(const std::string& address) {
    on_thread([&] { boards_.erase(address); });
  }
  int asked(const std::string& address) {
    return on_thread([&] { return boards_.at(address)->asked; });
  }

  std::uint16_t port() const { return port_; }

  // A short search at 127.0.<place> of each place. Without places: at the addresses of these boards.
  BoardSearch search(std::vector<std::string> places = {}) {
    const auto add_all = [&] {
      for (const auto& [address, board] : boards_) places.push_back(address);
    };
    if (places.empty()) on_thread(add_all);
    std::vector<BoardSearch::Network> networks;
    for (const std::string& place : places) {
      networks.push_back({"lo", 0, asio::ip::address_v4::loopback(),
                          asio::ip::make_address_v4("127.0." + place), ""});
    }
    BoardSearch search;
    search.port = port_;
    search.between = std::chrono::milliseconds(20);
    search.patience = std::chrono::milliseconds(200);
    search.networks = [networks] { return networks; };
    return search;
  }

 private:
  struct One {
    One(asio::io_context& io, const asio::ip::udp::endpoint& at)
        : socket(io, at), other(io, at.protocol()) {}
    asio::ip::udp::socket socket;
    asio::ip::udp::socket other;
    std::string elsewhere;
    asio::ip::udp::endpoint asker;
    char buffer[2048];
    Answers answers;
    int first = 1;
    int asked = 0;
  };

  void receive(One& board) {
    board.socket.async_receive_from(
        asio::buffer(board.buffer), board.asker,
        [this, &board](const asio::error_code& error, std::size_t) {
          if (error) return;  // the board may be deleted
          if (++board.asked >= board.first) {
            asio::error_code ignored;
            if (!board.elsewhere.empty()) {
              board.other.send_to(asio::buffer(board.elsewhere), board.asker, 0, ignored);
            }
            for (const std::string& answer : board.answers) {
              board.socket.send_to(asio::buffer(answer), board.asker, 0, ignored);
            }
          }
          receive(board);
        });
  }

  template <class Action>
  std::invoke_result_t<Action> on_thread(Action action) {
    std::packaged_task<std::invoke_result_t<Action>()> task(action);
    auto done = task.get_future();
    asio::post(io_, [&task] { task(); });
    return done.get();
  }

  asio::io_context io_{1};
  asio::executor_work_guard<asio::io_context::executor_type> work_{io_.get_executor()};
  std::map<std::string, std::unique_ptr<One>> boards_;
  std::uint16_t port_ = 0;
  std::thread thread_;
};

}  // namespace r4::test

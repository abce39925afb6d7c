// SPDX-License-Identifier: GPL-3.0-or-later
// The connection of a program to the program that holds the transport. If the holder is silent for
// answer_within, it is asked whether it is alive, and has the same time to answer: the board may be
// silent, and the holder well.
#pragma once

#include <array>
#include <asio/io_context.hpp>
#include <chrono>
#include <string>
#include <string_view>

#include "../operation_slot.hpp"
#include "../share_name.hpp"
#include "r4link/carrier.hpp"
#include "share_message.hpp"
#include "share_socket.hpp"

namespace r4 {

class ShareClient {
 public:
  static constexpr std::chrono::milliseconds answer_within{400};

  // Called on the loop's thread.
  class Owner {
   public:
    virtual void on_message(const ShareMessage& message) = 0;
    virtual void on_all_heard() = 0;  // all messages that had arrived were handed over
    // The holder does not answer, or is of another version of R4 link. Called repeatedly until it
    // answers.
    virtual void on_no_help(const Problem& why) = 0;
    // The connection has ended.
    virtual void on_closed() = 0;

   protected:
    ~Owner() = default;
  };

  ShareClient(asio::io_context& io, Owner& owner) : owner_(owner), connection_(io), timer_(io) {}
  ~ShareClient() { leave(); }
  ShareClient(const ShareClient&) = delete;
  ShareClient& operator=(const ShareClient&) = delete;

  enum class Joined { holder, nobody, stranger, crowd };
  // Connects to the holder with that role, and sends `greeting`. `stranger`: a program of another
  // user has taken the name. `crowd`: so many programs wait for the holder that no other one can.
  // Throws std::system_error if the system does not let the loop wait for the connection. `thing`:
  // the transport, for problems.
  Joined join(const ShareName& name, BoardRole role, ShareMessage::Kind greeting,
              const std::string& thing);
  // An E:STOP for the board.
  SendResult send_stop(std::string_view datagram);
  void leave() noexcept;

  // The process that holds the transport; 0: not known.
  pid_t process() const { return process_; }
  Problem silence() const;

 private:
  void listen();
  void receive();
  void expect_answer();
  void look_for_answer();

  Owner& owner_;
  LoopDescriptor connection_;
  OperationSlot readable_;
  LoopTimer timer_;
  OperationSlot answering_;
  std::string thing_;
  pid_t process_ = 0;
  bool heard_ = false;  // since look_for_answer()
  bool asked_ = false;  // and the holder has not answered
  std::array<char, ShareMessage::max_size + 1> packet_;
};

}  // namespace r4

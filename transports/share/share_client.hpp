// SPDX-License-Identifier: GPL-3.0-or-later
// The connection of a program to the one that holds the transport. A holder that is silent for
// answer_within is asked whether it is alive, and has as long again to answer: a silent board is
// not a holder that hangs.
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
    virtual void on_all_heard() = 0;  // what had arrived was handed over
    // The holder does not answer, or is of another version of R4 link. Called again until it
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
  // Connects to the holder with that role, and sends `greeting`. A stranger has taken the name; a
  // crowd waits for the holder, so that there is no room for another program. Throws
  // std::system_error if the system does not let the loop wait for the connection. `thing`: the
  // transport, for problems.
  Joined join(const ShareName& name, BoardRole role, ShareMessage::Kind greeting,
              const std::string& thing);
  // An E:STOP for the board.
  SendResult send_stop(std::string_view datagram);
  void leave() noexcept;

  // The process that holds the transport.
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
  bool heard_ = false;  // since the last look
  bool asked_ = false;  // and no answer yet
  std::array<char, ShareMessage::max_size + 1> packet_;
};

}  // namespace r4

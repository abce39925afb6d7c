// SPDX-License-Identifier: GPL-3.0-or-later
// A program's connection to the program that holds the transport. A holder that is silent for
// answer_within is asked to answer within the same time, because perhaps only the board is silent.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
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
    virtual void on_all_heard() = 0;  // all arrived messages were delivered
    // The holder does not answer, or has another version of R4 link. Repeated until an answer. The
    // problem's thing is empty.
    virtual void on_no_help(const Problem& why) = 0;
    virtual void on_closed() = 0;

   protected:
    ~Owner() = default;
  };

  ShareClient(asio::io_context& io, Owner& owner) : owner_(owner), connection_(io), timer_(io) {}
  ~ShareClient() { leave(); }
  ShareClient(const ShareClient&) = delete;
  ShareClient& operator=(const ShareClient&) = delete;

  enum class Joined { holder, nobody, stranger, crowd };
  // Connects to the holder with that role, and sends `greeting`. `stranger`: another user's program
  // has the name. `crowd`: too many programs wait for the holder. Throws std::system_error if the
  // loop cannot wait for the connection.
  Joined join(const ShareName& name, BoardRole role, ShareMessage::Kind greeting);
  SendResult send_stop(std::string_view datagram);
  void leave() noexcept;

  // The process that holds the transport; 0: not known.
  pid_t process() const { return process_; }
  Problem silence() const;

 private:
  void listen();
  void receive();
  void expect_answer();

  Owner& owner_;
  LoopDescriptor connection_;
  OperationSlot readable_;
  LoopTimer timer_;
  OperationSlot answering_;
  pid_t process_ = 0;
  // 0: the holder was heard since the last expect_answer(); 1: not heard; 2: asked, and not heard.
  int silence_ = 0;
};

}  // namespace r4

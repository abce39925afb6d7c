// SPDX-License-Identifier: GPL-3.0-or-later
#include "bare_frames.hpp"

#include <sched.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>

#include "r4link/can/can_ids.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"

namespace r4::bench {

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::uint8_t bare_node = 8;
constexpr int batch = 64;

class BareEnd : test::CanSocket {
 public:
  BareEnd(std::uint32_t heard_id, std::uint32_t sent_id, Wait wait)
      : CanSocket(SOCK_RAW, CAN_RAW),
        flags_(wait == Wait::looking ? MSG_DONTWAIT : MSG_WAITFORONE) {
    set(SOL_CAN_RAW, CAN_RAW_FILTER, can_filter{heard_id, CAN_SFF_MASK}, "CAN_RAW_FILTER");
    set(SOL_SOCKET, SO_RCVBUF, 1 << 20, "SO_RCVBUF");
    bind_to_interface({});
    for (std::size_t i = 0; i < batch; ++i) {
      frames_[i].can_id = sent_id;
      frames_[i].can_dlc = CAN_MAX_DLEN;
      sent_[i] = message(frames_[i], sent_parts_[i]);
      received_[i] = message(heard_[i], received_parts_[i]);
    }
  }

  void send(int count) {
    for (int done = 0; done < count;) {
      const int sent = ::sendmmsg(fd(), sent_.data(), static_cast<unsigned>(count - done), 0);
      if (sent > 0) done += sent;
      if (sent < 0 && errno != ENOBUFS) fail("sendmmsg");
    }
  }
  void receive(int count) {
    for (int done = 0; done < count;) {
      const int got =
          ::recvmmsg(fd(), received_.data(), static_cast<unsigned>(count - done), flags_, nullptr);
      if (got > 0) {
        done += got;
      } else if (errno == EAGAIN) {
        ::sched_yield();
      } else {
        fail("recvmmsg");
      }
    }
  }

 private:
  static mmsghdr message(can_frame& frame, iovec& part) {
    part = {&frame, sizeof frame};
    mmsghdr message{};
    message.msg_hdr.msg_iov = &part;
    message.msg_hdr.msg_iovlen = 1;
    return message;
  }

  int flags_;
  std::array<can_frame, batch> frames_{}, heard_{};
  std::array<iovec, batch> sent_parts_{}, received_parts_{};
  std::array<mmsghdr, batch> sent_{}, received_{};
};

}  // namespace

const char* to_text(Wait wait) { return wait == Wait::sleeping ? "sleeping" : "looking"; }

BareEchoProcess::BareEchoProcess(Wait wait, int question_frames, int answer_frames) {
  if (!fork_child()) {
    char ready = 0;
    read_all(control_, &ready, 1);
    return;
  }
  BareEnd end(command_id(bare_node), reply_id(bare_node), wait);
  write_all(control_, "r", 1);
  for (;;) {
    end.receive(1);
    end.send(1);
    end.receive(question_frames - 1);
    end.send(answer_frames);
  }
}

std::vector<double> bare_round_trips(Wait wait, int question_frames, int answer_frames, int count) {
  const BareEchoProcess echo(wait, question_frames, answer_frames);
  BareEnd end(reply_id(bare_node), command_id(bare_node), wait);
  std::vector<double> seconds;
  while (count-- > 0) {
    const auto start = Clock::now();
    end.send(1);
    end.receive(1);
    end.send(question_frames - 1);
    end.receive(answer_frames);
    seconds.push_back(std::chrono::duration<double>(Clock::now() - start).count());
  }
  return seconds;
}

BareSenderProcess::BareSenderProcess(Lane lane, int frames) : lane_(lane), frames_(frames) {
  if (!fork_child()) {
    char ready = 0;
    read_all(control_, &ready, 1);
    return;
  }
  BareEnd end(command_id(bare_node), reply_id(bare_node), Wait::looking);
  write_all(control_, "r", 1);
  for (;;) {
    const std::uint32_t count = next_count(control_);
    for (std::uint32_t sent = 0; sent < count; ++sent) {
      if (lane == Lane::dialogue) {
        end.send(1);
        end.receive(1);
        end.send(frames - 1);
      } else {
        await_room(received_, sent);
        end.send(frames);
      }
    }
  }
}

double BareSenderProcess::rate(std::uint32_t count) const {
  BareEnd end(reply_id(bare_node), command_id(bare_node), Wait::looking);
  received_.set(0);
  const auto start = Clock::now();
  write_all(control_, &count, sizeof count);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (lane_ == Lane::dialogue) {
      end.receive(1);
      end.send(1);
      end.receive(frames_ - 1);
    } else {
      end.receive(frames_);
    }
    received_.add_one();
  }
  return count / std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace r4::bench

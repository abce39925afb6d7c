// SPDX-License-Identifier: GPL-3.0-or-later
// Sender and receiver joined frame by frame in virtual time. A failure prints RC_PARAMS with its
// seed. To repeat the failure, set the same RC_PARAMS in the environment.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "tests/transports/framing/can/can_frames.hpp"
#include "transports/framing/can/isotp_receiver.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4 {
namespace {

using Datagrams = std::vector<std::string>;

std::string random_bytes(std::size_t size, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

struct Options {
  IsotpSenderOptions sender;
  IsotpReceiverOptions receiver;
};

Options burst(std::uint8_t tx_dl = 8) {
  Options options;
  options.sender.channel.fd = tx_dl > 8;
  options.sender.tx_dl = tx_dl;
  options.sender.flow_control = false;
  options.receiver.listen_only = true;
  return options;
}

// Random options that fit for both ends.
rc::Gen<Options> any_options() {
  return rc::gen::exec([] {
    Options options;
    IsotpChannel channel;
    channel.id = *rc::gen::inRange(0U, max_can_id);
    channel.flow_control_id = channel.id + 1;
    channel.padding = *rc::gen::arbitrary<bool>();
    channel.padding_byte = *rc::gen::arbitrary<std::uint8_t>();
    channel.fd = *rc::gen::arbitrary<bool>();
    options.sender.channel = options.receiver.channel = channel;
    options.sender.tx_dl = *rc::gen::element<std::uint8_t>(8, 12, 16, 20, 24, 32, 48, 64);
    options.sender.flow_control = *rc::gen::arbitrary<bool>();
    options.sender.separation_us = *rc::gen::element(0U, 0U, 250U, 3000U);
    options.receiver.listen_only = !options.sender.flow_control;
    options.receiver.block_size = *rc::gen::arbitrary<std::uint8_t>();
    options.receiver.stmin = *rc::gen::arbitrary<std::uint8_t>();
    options.receiver.n_cr_us = 200000;  // longer than any gap that STmin can request
    return options;
  });
}

// The frames that the sender puts on the bus without an answer.
std::vector<CanFrame> frames_of(const Options& options, const std::string& datagram) {
  IsotpSender sender(options.sender);
  std::vector<CanFrame> frames;
  std::uint32_t now = 0;
  sender.begin(datagram, now);
  for (CanFrame frame; sender.busy(); now = sender.deadline().at_us) {
    if (!sender.offer(now, frame)) break;
    frames.push_back(frame);
    sender.frame_sent(now);
  }
  return frames;
}

// The result of receiving the frames, one frame every `step_us`.
struct Received {
  Datagrams datagrams;
  IsotpReceiverCounters counters;
};

Received receive(const Options& options, const std::vector<CanFrame>& frames,
                 std::uint32_t step_us = 100) {
  std::string buffer(1024, '\0');
  IsotpReceiver receiver(options.receiver, buffer.data(), 1024);
  Received outcome;
  std::uint32_t now = 0xFFFFFF00;
  for (const CanFrame& frame : frames) {
    if (receiver.on_frame(frame, now).datagram) {
      outcome.datagrams.emplace_back(receiver.text().data(), receiver.text().size());
    }
    now += step_us;
  }
  receiver.poll(now + options.receiver.n_cr_us);
  outcome.counters = receiver.counters();
  return outcome;
}

// Both ends on one bus that may refuse or lose frames.
class IsotpBus {
 public:
  IsotpBus(const Options& options, std::uint32_t capacity)
      : sender(options.sender),
        buffer_(capacity, '\0'),
        receiver(options.receiver, buffer_.data(), capacity) {}

  // Runs one transfer to its end. `refuses()`: the bus has no room. `loses()`: the bus loses the
  // frame.
  template <class Refuses, class Loses>
  Datagrams transfer(const std::string& datagram, Refuses refuses, Loses loses) {
    Datagrams datagrams;
    RC_ASSERT(sender.begin(datagram, now));
    while (sender.busy() || receiver.busy()) {
      bool moved = false;
      CanFrame frame;
      if (sender.offer(now, frame) && !refuses()) {
        sender.frame_sent(now);
        moved = true;
        if (!loses() && receiver.on_frame(frame, now).datagram) {
          datagrams.emplace_back(receiver.text().data(), receiver.text().size());
        }
      }
      if (receiver.offer(now, frame) && !refuses()) {
        receiver.frame_sent(now);
        moved = true;
        if (!loses()) sender.on_frame(frame, now);
      }
      if (!moved) advance();
    }
    return datagrams;
  }

  IsotpSender sender;

 private:
  // If the bus refuses a frame, advances by 200 us. Otherwise advances to the next deadline.
  void advance() {
    std::uint32_t wait = 200;
    const IsotpDeadline deadlines[] = {sender.deadline(), receiver.deadline()};
    for (const IsotpDeadline& deadline : deadlines) {
      if (deadline.armed && !reached(now, deadline.at_us)) {
        wait = std::min(wait, deadline.at_us - now);
      }
    }
    now += wait;
    sender.poll(now);
    receiver.poll(now);
  }

  std::string buffer_;

 public:
  IsotpReceiver receiver;
  std::uint32_t now = 0xFFFF0000;  // wraps during long transfers
};

RC_GTEST_PROP(Isotp, AnyDatagramArrivesByteForByte, ()) {
  const Options options = *any_options();
  const auto size =
      static_cast<std::size_t>(*rc::gen::weightedOneOf<int>({{6, rc::gen::inRange(1, 1025)},
                                                             {3, rc::gen::inRange(1, 130)},
                                                             {1, rc::gen::inRange(4090, 4101)}}));
  const std::string datagram = random_bytes(size, *rc::gen::arbitrary<std::uint32_t>());
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  const bool busy_bus = *rc::gen::arbitrary<bool>();
  IsotpBus bus(options, 4100);
  const auto refuses = [&] { return busy_bus && random() % 4 == 0; };
  for (int round = 0; round < 2; ++round) {
    RC_ASSERT(bus.transfer(datagram, refuses, [] { return false; }) == Datagrams{datagram});
    RC_ASSERT(bus.sender.error() == IsotpError::none);
  }
  const IsotpReceiverCounters& c = bus.receiver.counters();
  RC_ASSERT(c.started == 2U && c.datagrams == 2U);
  RC_ASSERT(c.frames == bus.sender.counters().frames);
  RC_ASSERT(c.unexpected_frame + c.malformed == 0U);
}

// Every length, every frame length and both formats of padding, without flow control and without
// random values.
TEST(Isotp, EveryLengthInEveryFrameLengthArrives) {
  const std::uint8_t lengths[] = {8, 12, 16, 20, 24, 32, 48, 64};
  for (const std::uint8_t tx_dl : lengths) {
    for (const bool padding : {false, true}) {
      Options options = burst(tx_dl);
      options.sender.channel.padding = padding;
      for (std::size_t size = 1; size <= 1024; ++size) {
        const std::string datagram = random_bytes(size, static_cast<std::uint32_t>(size));
        const Received outcome = receive(options, frames_of(options, datagram));
        ASSERT_EQ(outcome.datagrams, Datagrams{datagram}) << size << " in frames of " << +tx_dl;
      }
    }
  }
}

TEST(Isotp, ADatagramOf170BytesIs25ClassicFrames) {
  EXPECT_EQ(frames_of(burst(), std::string(170, 'x')).size(), 25U);
  EXPECT_EQ(frames_of(burst(), std::string(45, 'x')).size(), 7U);
  EXPECT_EQ(frames_of(burst(), std::string(48, 'x')).size(), 7U);
}

RC_GTEST_PROP(Isotp, WithFlowControlALossCostsTheDatagramAndIsToldOf, ()) {
  Options options = *any_options();
  options.sender.flow_control = true;
  options.receiver.listen_only = false;
  const auto size = static_cast<std::size_t>(*rc::gen::inRange(1, 1025));
  const auto loss = static_cast<unsigned>(*rc::gen::inRange(1, 60));
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  IsotpBus bus(options, 1024);
  std::uint32_t delivered = 0;
  for (std::uint32_t round = 0; round < 10; ++round) {
    const std::string datagram = random_bytes(size, round);
    unsigned lost = 0;
    const Datagrams datagrams = bus.transfer(
        datagram, [] { return false; },
        [&] {
          const bool loses = random() % 100 < loss;
          lost += loses;
          return loses;
        });
    RC_ASSERT(datagrams == (datagrams.empty() ? Datagrams{} : Datagrams{datagram}));
    RC_ASSERT(datagrams.empty() == (lost != 0));
    delivered += static_cast<std::uint32_t>(datagrams.size());
  }
  const IsotpSenderCounters& s = bus.sender.counters();
  const IsotpReceiverCounters& r = bus.receiver.counters();
  RC_ASSERT(r.datagrams == delivered);
  RC_ASSERT(s.started == 10U && s.datagrams + s.flow_control_timeout == 10U);
  RC_ASSERT(r.started == r.datagrams + r.consecutive_timeout + r.wrong_sequence_number);
}

// Within one transfer, any frames may be lost, duplicated, or overtaken by fewer than 16 numbers.
RC_GTEST_PROP(Isotp, DamageToTheOrderOfFramesGivesTheBytesOrNothing, ()) {
  const Options options = burst(*rc::gen::element<std::uint8_t>(8, 8, 12, 20, 64));
  const auto size = static_cast<std::size_t>(*rc::gen::inRange(1, 1025));
  const std::string datagram = random_bytes(size, *rc::gen::arbitrary<std::uint32_t>());
  const std::vector<CanFrame> sent = frames_of(options, datagram);
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  const auto kinds = static_cast<unsigned>(*rc::gen::inRange(1, 8));
  std::vector<CanFrame> frames = sent;
  const auto damages = *rc::gen::inRange(1, 5);
  for (int damage = 0; damage < damages && !frames.empty(); ++damage) {
    const std::size_t at = random() % frames.size();
    const auto place = frames.begin() + static_cast<std::ptrdiff_t>(at);
    switch (kinds >> (random() % 3) & 1 ? random() % 3 : 0) {
      case 0:
        frames.erase(place);
        break;
      case 1:
        frames.insert(place, frames[at]);
        break;
      default:
        std::swap(*place, frames[std::min(at + 1 + random() % 2, frames.size() - 1)]);
    }
  }
  const Received outcome = receive(options, frames);
  for (const std::string& delivered : outcome.datagrams) RC_ASSERT(delivered == datagram);
  const IsotpReceiverCounters& c = outcome.counters;
  const std::uint32_t errors = c.wrong_sequence_number + c.interrupted + c.consecutive_timeout +
                               c.unexpected_frame + c.malformed;
  RC_ASSERT(outcome.datagrams.size() == 1 || errors != 0 || c.frames == 0 || sent.size() == 1);
  RC_ASSERT(c.started ==
            c.datagrams + c.wrong_sequence_number + c.interrupted + c.consecutive_timeout);
}

// A stream of datagrams with a pause of N_Cr between them, and any loss.
RC_GTEST_PROP(Isotp, AListenerInALossyStreamHearsWhatWasSentOrNothing, ()) {
  const Options options = burst();
  const auto size = static_cast<std::size_t>(*rc::gen::inRange(1, 400));
  const auto loss = static_cast<unsigned>(*rc::gen::inRange(1, 100));
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  char buffer[1024];
  IsotpReceiver receiver(options.receiver, buffer, sizeof buffer);
  std::uint32_t now = 0;
  std::uint32_t whole = 0;
  for (std::uint32_t round = 0; round < 30; ++round) {
    const std::string datagram = random_bytes(size, round);
    bool lost = false;
    for (const CanFrame& frame : frames_of(options, datagram)) {
      if (random() % 100 < loss) {
        lost = true;
      } else if (receiver.on_frame(frame, now += 130).datagram) {
        RC_ASSERT(receiver.text() == Text(datagram));
      }
    }
    whole += !lost;
    RC_ASSERT(receiver.counters().datagrams == whole);
    now += options.receiver.n_cr_us;
  }
}

// The exception that the header describes: the numbers fit again over the border of two transfers.
TEST(Isotp, LossWithoutFlowControlCanJoinTwoDatagrams) {
  const struct {
    std::size_t size, kept;
    std::size_t lost;  // lost consecutive frames, including the second first frame
  } cases[] = {
      {6 + 7 * 15, 10, 16},  // transfers of 16 frames
      {6 + 7 * 31, 20, 16},  // transfers of 32 frames
      {6 + 7 * 31, 20, 32},  //
      {170, 20, 9},          // transfers of 25 frames
      {170, 18, 25},         //
  };
  for (const auto& c : cases) {
    const std::string first(c.size, 'a');
    const std::string second(c.size, 'b');
    std::vector<CanFrame> frames = frames_of(burst(), first);
    for (const CanFrame& frame : frames_of(burst(), second)) frames.push_back(frame);
    const auto from = frames.begin() + static_cast<std::ptrdiff_t>(c.kept);
    frames.erase(from, from + static_cast<std::ptrdiff_t>(c.lost));

    const Received joined = receive(burst(), frames);
    const std::size_t of_first = 6 + 7 * (c.kept - 1);
    EXPECT_EQ(joined.datagrams, Datagrams{first.substr(0, of_first) + second.substr(of_first)})
        << "only the CRC of the datagram detects this";

    Options patient = burst();
    patient.receiver.n_cr_us = 100;  // less than the pause between the transfers
    EXPECT_EQ(receive(patient, frames).datagrams, Datagrams{});
  }
}

}  // namespace
}  // namespace r4

// SPDX-License-Identifier: GPL-3.0-or-later
// Our ISO-TP engine and the kernel's engine on one bus, without faults. For tools/with-can.
#include "tests/transports/can/kernel/kernel_isotp.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>

#include "tests/transports/can/kernel/isotp_on_raw_can.hpp"
#include "tests/transports/can/kernel/raw_can.hpp"

namespace r4::test {
namespace {

unsigned faults(const IsotpReceiverCounters& counters) {
  return counters.send_timeout + counters.consecutive_timeout + counters.wrong_sequence_number +
         counters.interrupted + counters.too_many_waits + counters.cancelled + counters.overflow +
         counters.unexpected_frame + counters.malformed;
}

struct EngineToKernel {
  explicit EngineToKernel(const Form& form) : EngineToKernel(sender_of(form), kernel_of(form)) {}
  EngineToKernel(const IsotpSenderOptions& options, const KernelIsotpOptions& peer)
      : kernel(data_id, flow_control_id, peer), bus(flow_control_id), sender(options) {}

  KernelIsotp kernel;
  RawCan bus;
  IsotpSender sender;
};

struct KernelToEngine {
  explicit KernelToEngine(const Form& form) : KernelToEngine(kernel_of(form), receiver_of(form)) {}
  KernelToEngine(const KernelIsotpOptions& peer, const IsotpReceiverOptions& options)
      : kernel(flow_control_id, data_id, peer),
        bus(data_id),
        buffer(max_size, '\0'),
        receiver(options, buffer.data(), max_size) {}
  std::string received() const { return {receiver.text().data(), receiver.text().size()}; }

  static constexpr std::uint32_t max_size = 10000;
  KernelIsotp kernel;
  RawCan bus;
  std::string buffer;
  IsotpReceiver receiver;
};

class KernelIsotpForms : public testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(, KernelIsotpForms, testing::ValuesIn(forms),
                         [](const auto& form) { return form.param.name; });

TEST_P(KernelIsotpForms, ReceivesEveryLengthFromTheEngine) {
  EngineToKernel link(GetParam());
  std::uint32_t datagrams = 0;
  for (std::uint32_t size = 0; size < longest_length; ++datagrams) {
    size = next_length(size);
    const std::string datagram = content_of(size);
    const Course course = drive(link.bus, link.sender, datagram);
    ASSERT_EQ(course.error, IsotpError::none) << size << " bytes: " << to_text(course.error).data();
    ASSERT_TRUE(link.kernel.receive() == datagram)
        << size << " bytes: " << std::strerror(link.kernel.error());
  }
  EXPECT_EQ(link.kernel.receive(0), std::nullopt);
  EXPECT_EQ(link.kernel.error(), 0);
  EXPECT_EQ(link.sender.counters().datagrams, datagrams);
  EXPECT_EQ(link.sender.counters().unexpected_frame, 0U);
  EXPECT_EQ(link.sender.counters().malformed, 0U);
}

TEST_P(KernelIsotpForms, SendsEveryLengthToTheEngine) {
  IsotpReceiverOptions options = receiver_of(GetParam());
  options.block_size = 200;  // the buffer of a socket holds this number of frames
  KernelToEngine link(kernel_of(GetParam()), options);
  std::uint32_t datagrams = 0;
  for (std::uint32_t size = 0; size < longest_length; ++datagrams) {
    size = next_length(size);
    const std::string datagram = content_of(size);
    link.kernel.send(datagram);
    const Course course = drive(link.bus, link.receiver);
    ASSERT_EQ(course.error, IsotpError::none) << size << " bytes: " << to_text(course.error).data();
    ASSERT_TRUE(link.received() == datagram) << size << " bytes";
  }
  EXPECT_EQ(link.kernel.error(), 0);
  EXPECT_EQ(link.receiver.counters().datagrams, datagrams);
  EXPECT_EQ(faults(link.receiver.counters()), 0U);
}

TEST_P(KernelIsotpForms, ReceivesFromTheEngineWithoutFlowControl) {
  IsotpSenderOptions options = sender_of(GetParam());
  options.flow_control = false;
  KernelIsotpOptions listening = kernel_of(GetParam());
  listening.flags |= CAN_ISOTP_LISTEN_MODE;
  EngineToKernel link(options, listening);
  KernelIsotp second_listener(data_id, flow_control_id, listening);
  for (const std::uint32_t size : {1U, 7U, 8U, 62U, 63U, 170U, 508U, 1024U}) {
    const std::string datagram = content_of(size);
    ASSERT_EQ(drive(link.bus, link.sender, datagram).error, IsotpError::none);
    EXPECT_TRUE(link.kernel.receive() == datagram);
    EXPECT_TRUE(second_listener.receive() == datagram);
  }
  CanFrame frame;
  EXPECT_FALSE(link.bus.receive(frame, clock_us())) << "the listener sent a frame";
}

TEST_P(KernelIsotpForms, BroadcastsToTheListeningEngine) {
  KernelIsotpOptions broadcasting = kernel_of(GetParam());
  broadcasting.flags |= CAN_ISOTP_CF_BROADCAST;
  IsotpReceiverOptions listening = receiver_of(GetParam());
  listening.listen_only = true;
  KernelToEngine link(broadcasting, listening);
  for (const std::uint32_t size : {1U, 7U, 8U, 62U, 63U, 170U, 508U, 1024U}) {
    const std::string datagram = content_of(size);
    link.kernel.send(datagram);
    const Course course = drive(link.bus, link.receiver);
    EXPECT_EQ(course.error, IsotpError::none);
    EXPECT_EQ(course.answers, 0U);
    EXPECT_TRUE(link.received() == datagram);
  }
  EXPECT_EQ(faults(link.receiver.counters()), 0U);
}

TEST(KernelIsotp, AgreesWithTheEngineOnEveryFrameSizeOfFd) {
  constexpr std::uint8_t frame_sizes[] = {12, 16, 20, 24, 32, 48};
  // Three frames of the longest size, and more frames of each shorter size.
  constexpr std::uint32_t longest = 150;
  for (const std::uint8_t tx_dl : frame_sizes) {
    const Form form{"", tx_dl, false};
    for (EngineToKernel link(form); link.sender.counters().started < longest;) {
      const std::string datagram = content_of(link.sender.counters().started + 1);
      ASSERT_EQ(drive(link.bus, link.sender, datagram).error, IsotpError::none);
      ASSERT_TRUE(link.kernel.receive() == datagram) << datagram.size() << " by " << int{tx_dl};
    }
    for (KernelToEngine link(form); link.receiver.counters().started < longest;) {
      const std::string datagram = content_of(link.receiver.counters().started + 1);
      link.kernel.send(datagram);
      ASSERT_EQ(drive(link.bus, link.receiver).error, IsotpError::none);
      ASSERT_TRUE(link.received() == datagram) << datagram.size() << " by " << int{tx_dl};
    }
  }
}

// The requests of a receiver: BS and STmin as bytes on the wire.
struct Pace {
  std::uint8_t block_size;
  std::uint8_t stmin;
};
constexpr Pace paces[] = {{0, 0}, {1, 0}, {7, 0}, {255, 0}, {0, 0xF5}, {0, 2}, {8, 0xF1}, {1, 1}};
constexpr std::uint32_t paced_size = 510;
constexpr unsigned paced_consecutive = (paced_size - 6) / 7;

// The number of flow controls of a transfer, and the shortest total time of its gaps. There is no
// gap at the end of a block.
unsigned answers(const Pace& pace) {
  return pace.block_size == 0 ? 1 : 1 + (paced_consecutive - 1) / pace.block_size;
}
std::uint32_t least_us(const Pace& pace) {
  return (paced_consecutive - answers(pace)) * stmin_to_us(pace.stmin);
}

TEST(KernelIsotp, GetsTheBlockSizeAndTheGapThatItAsksTheEngineFor) {
  const std::string datagram = content_of(paced_size);
  for (const Pace& pace : paces) {
    KernelIsotpOptions options = kernel_of(classic);
    options.block_size = pace.block_size;
    options.stmin = pace.stmin;
    EngineToKernel link(sender_of(classic), options);
    const Course course = drive(link.bus, link.sender, datagram);
    EXPECT_EQ(course.error, IsotpError::none);
    EXPECT_TRUE(link.kernel.receive() == datagram) << "STmin " << int{pace.stmin};
    EXPECT_EQ(course.answers, answers(pace)) << "BS " << int{pace.block_size};
    EXPECT_GE(course.least_gap_us, stmin_to_us(pace.stmin)) << "STmin " << int{pace.stmin};
    EXPECT_GE(course.took_us, least_us(pace)) << "STmin " << int{pace.stmin};
  }
}

TEST(KernelIsotp, KeepsTheBlockSizeAndTheGapThatTheEngineAsksFor) {
  const std::string datagram = content_of(paced_size);
  for (const Pace& pace : paces) {
    IsotpReceiverOptions options = receiver_of(classic);
    options.block_size = pace.block_size;
    options.stmin = pace.stmin;
    KernelToEngine link(kernel_of(classic), options);
    link.kernel.send(datagram);
    const Course course = drive(link.bus, link.receiver);
    EXPECT_EQ(course.error, IsotpError::none);
    EXPECT_TRUE(link.received() == datagram);
    EXPECT_EQ(course.answers, answers(pace)) << "BS " << int{pace.block_size};
    EXPECT_GE(course.took_us, least_us(pace)) << "STmin " << int{pace.stmin};
    EXPECT_EQ(faults(link.receiver.counters()), 0U);
  }
}

TEST(KernelIsotp, WaitsAsLongAsTheEngineRequests) {
  IsotpReceiverOptions options = receiver_of(classic);
  options.wait_gap_us = 10000;
  options.max_waits = 100;
  KernelToEngine link(kernel_of(classic), options);
  const std::string datagram = content_of(100);
  link.receiver.hold(true, clock_us());
  link.kernel.send(datagram);
  const std::uint32_t until_us = clock_us() + 10000000;
  CanFrame frame;
  unsigned waits = 0;
  while (waits < 3 && !reached(clock_us(), until_us)) {
    if (link.receiver.offer(clock_us(), frame)) {
      link.bus.send(frame);
      link.receiver.frame_sent(clock_us());
      ++waits;
    } else {
      const IsotpDeadline next = link.receiver.deadline();
      const bool sooner = next.armed && reached(until_us, next.at_us);
      if (link.bus.receive(frame, sooner ? next.at_us : until_us)) {
        link.receiver.on_frame(frame, clock_us());
      }
    }
  }
  EXPECT_EQ(waits, 3U);
  EXPECT_EQ(link.receiver.counters().consecutive, 0U);
  link.receiver.hold(false, clock_us());
  EXPECT_EQ(drive(link.bus, link.receiver).error, IsotpError::none);
  EXPECT_TRUE(link.received() == datagram);
}

}  // namespace
}  // namespace r4::test

// SPDX-License-Identifier: GPL-3.0-or-later
// The topics of docs/examples/openpodcar, with a joystick in the same process and no other participants.
#include <dds/dds.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>

#include "docs/examples/openpodcar/pilot.hpp"
#include "docs/examples/openpodcar/topics.hpp"
#include "podcar_ros2.h"

namespace {

using namespace std::chrono_literals;

constexpr const char* alone =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery>"
    "<ParticipantIndex>none</ParticipantIndex></Discovery></Domain></CycloneDDS>";
constexpr dds_domainid_t domain = 231;  // other tests use the domains up to 200

class Joystick {
 public:
  Joystick() : participant_(dds_create_participant(domain, nullptr, nullptr)) {
    const std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)> qos(dds_create_qos(),
                                                                    dds_delete_qos);
    constexpr dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
    dds_qset_data_representation(qos.get(), 1, &xcdr1);
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    const dds_entity_t topic =
        dds_create_topic(participant_, &sensor_msgs_msg_dds__Joy__desc, "rt/joy", nullptr, nullptr);
    writer_ = dds_create_writer(participant_, topic, qos.get(), nullptr);
  }
  ~Joystick() { dds_delete(participant_); }
  Joystick(const Joystick&) = delete;
  Joystick& operator=(const Joystick&) = delete;

  bool is_heard() const {
    dds_publication_matched_status_t status{};
    return dds_get_publication_matched_status(writer_, &status) == DDS_RETCODE_OK &&
           status.current_count > 0;
  }
  void publish(std::optional<std::size_t> pressed = {}) {
    static char frame[] = "";
    std::array<float, 6> axes{};
    std::array<std::int32_t, 8> buttons{};
    if (pressed) buttons.at(*pressed) = 1;
    sensor_msgs_msg_dds__Joy_ joy{};
    joy.header.frame_id = frame;
    joy.axes = {axes.size(), axes.size(), axes.data(), false};
    joy.buttons = {buttons.size(), buttons.size(), buttons.data(), false};
    ASSERT_EQ(dds_write(writer_, &joy), DDS_RETCODE_OK);
  }

 private:
  dds_entity_t participant_;
  dds_entity_t writer_ = 0;
};

// Repeats the press: on a slow machine the messages received before the press may be too old.
bool press_start(Topics& topics, Pilot& pilot, Joystick& joystick) {
  const auto deadline = std::chrono::steady_clock::now() + 10s;
  while (pilot.mode() != Pilot::Mode::automatic && std::chrono::steady_clock::now() < deadline) {
    if (!joystick.is_heard()) continue;
    joystick.publish();
    topics.take(pilot, {});
    joystick.publish(JoyMap{}.start);
    topics.take(pilot, {});
  }
  return pilot.mode() == Pilot::Mode::automatic;
}

TEST(OpenPodcarTopics, StopsByAStopBehindWhichMuchHasComeWhileItWasNotTaken) {
  setenv("CYCLONEDDS_URI", alone, 1);
  setenv("ROS_DOMAIN_ID", std::to_string(domain).c_str(), 1);
  Topics topics;
  Pilot pilot;
  Joystick joystick;
  for (const int behind : {0, 1, 62, 63, 64, 200}) {
    ASSERT_TRUE(press_start(topics, pilot, joystick));
    joystick.publish(JoyMap{}.stop);
    for (int i = 0; i < behind; ++i) joystick.publish();
    topics.take(pilot, {});
    EXPECT_EQ(pilot.mode(), Pilot::Mode::off) << behind;
  }
  ASSERT_TRUE(press_start(topics, pilot, joystick));
  for (int i = 0; i < 63; ++i) joystick.publish();
  topics.take(pilot, {});
  EXPECT_EQ(pilot.mode(), Pilot::Mode::automatic) << "a message was lost";
}

}  // namespace

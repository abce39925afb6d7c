// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recording.hpp"

#include <map>
#include <string>

#include "../../protocol/messages/message.hpp"
#include "../../protocol/messages/state_fields.hpp"
#include "r4link/datagram.hpp"
#include "r4link/error.hpp"
#include "recorder.hpp"
#include "recording_reader.hpp"

namespace r4 {

Recording::Recording(const std::string& path, RecordingOptions options)
    : recorder_(std::make_shared<Recorder>(path, options)) {}
Recording::~Recording() { recorder_->close(); }

void Recording::close() { recorder_->close(); }
std::optional<Problem> Recording::problem() const { return recorder_->problem(); }
std::uint64_t Recording::records() const { return recorder_->records(); }
std::uint64_t Recording::dropped() const { return recorder_->dropped(); }

namespace {

// Gives a recording to a visitor.
class Tour final : public RecordingReader::Handler {
 public:
  explicit Tour(RecordingVisitor& visitor) : visitor_(visitor) {}

  void on_header() override {
    states_.clear();
    visitor_.on_beginning();
  }
  void on_path(const RecordedPath& path) override {
    visitor_.on_path(path.number, path.url, path.name);
  }
  void on_record(const Record& record) override {
    if (record.kind == RecordKind::event) {
      return visitor_.on_event(record.path, record.time, record.bytes);
    }
    const bool from_board = record.kind == RecordKind::from_board;
    visitor_.on_datagram(record.path, record.time, from_board, record.bytes);
    Datagram datagram;
    if (!from_board || !read_datagram(record.bytes, datagram) ||
        kind_of(datagram) != MessageKind::state) {
      return;
    }
    State& state = states_[record.path];
    if (read_state(datagram, state)) visitor_.on_state(record.path, record.time, state);
  }
  void on_device(const RecordedDevice& device) override {
    try {
      visitor_.on_device(device.path, Device::parse(device.place, device.description));
    } catch (const Error& error) {
      visitor_.on_damage(error.what());
    }
  }
  void on_damage(const RecordingDamage& damage) override {
    visitor_.on_damage("line " + std::to_string(damage.line) + ", byte " +
                       std::to_string(damage.offset) + ": " + std::string(damage.reason));
  }

 private:
  RecordingVisitor& visitor_;
  std::map<std::uint16_t, State> states_;
};

}  // namespace

void read_recording(const std::string& path, RecordingVisitor& visitor) {
  Tour tour(visitor);
  read_recording(path, tour);
}

}  // namespace r4

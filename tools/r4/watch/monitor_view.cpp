// SPDX-License-Identifier: GPL-3.0-or-later
#include "monitor_view.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "../boards/paths.hpp"
#include "../shell/json.hpp"
#include "../shell/output.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/link.hpp"
#include "r4link/messages/message.hpp"

namespace r4::tool {
namespace {

std::string_view view(Text text) { return {text.data(), text.size()}; }

constexpr std::size_t most_shown = 600;

std::string shown(std::string_view bytes) {
  std::array<char, most_shown + masking_room> room;
  const Text masked = without_secrets(Text(bytes.substr(0, most_shown)), room.data());
  return escaped(view(masked)) + (bytes.size() > most_shown ? "..." : "");
}

class JsonView final : public MonitorView {
 public:
  JsonView(const AsyncBoard& board, LineWriter& lines) : board_(board), lines_(lines) {}

  void on_state(const ReceivedState& state, const Datagram& datagram) override {
    Json json = object_of("state", datagram);
    const auto since_1970 = state.sampled_at_wall_time().time_since_epoch();
    json["sampled"] = std::round(std::chrono::duration<double>(since_1970).count() * 1e6) / 1e6;
    json["sampled_error_ms"] = nullptr;
    if (state.sampled_error != ReceivedState::unknown) {
      json["sampled_error_ms"] =
          std::chrono::duration<double, std::milli>(state.sampled_error).count();
    }
    lines_.write(line_of(json));
  }
  void on_heartbeat(const Datagram& datagram) override { print("heartbeat", datagram); }
  void on_reading(const DeviceNews& news) override {
    Json fields = Json::object();
    for (const DeviceNews::Value& value : news.values) {
      fields[value.meaning->name] = value.number ? Json(*value.number) : Json();
    }
    Json json = object("reading", std::move(fields));
    json["pnum"] = news.pnum;
    json["t"] = news.t_ms;
    json["device"] = news.device.text();
    lines_.write(line_of(json));
  }
  void on_device_trouble(const Problem& problem) override {
    lines_.write(line_of(object("error", {{"error", "device"},
                                          {"thing", problem.thing},
                                          {"reason", problem.reason},
                                          {"fix", problem.fix}})));
  }
  void on_nack(const Nack&, const Datagram& datagram) override { print("nack", datagram); }
  void on_bad_datagram(const ReadResult& result, std::string_view bytes) override {
    Json fields = bad_datagram_json(result);
    fields["text"] = shown(bytes);
    lines_.write(line_of(object("error", std::move(fields))));
  }
  void on_link(const LinkStatus& status) override {
    Json fields{{"up", up_},
                {"state", to_text(status.state)},
                {"reason", to_text(status.reason)},
                {"causes", causes_json(status.causes)}};
    if (Json paths = paths_json(board_); !paths.is_null()) fields["paths"] = std::move(paths);
    lines_.write(line_of(object("link", std::move(fields))));
  }
  void on_event(const CarrierEvent& event) override {
    if (event.kind != CarrierEvent::Kind::warning) up_ = event.kind == CarrierEvent::Kind::up;
    if (event.kind != CarrierEvent::Kind::up) {
      const Problem& problem = event.problem;
      lines_.write(line_of(object(
          "error", {{"error", "transport"}, {"reason", problem.reason}, {"fix", problem.fix}})));
    }
    on_link(board_.link());
  }
  void on_path(const PathStatus& path) override {
    lines_.write(line_of(object("path", path_json(path))));
  }
  void on_end() override {
    const std::vector<PathStatus> paths = board_.paths();
    for (const PathStatus& path : paths) {
      if (paths.size() > 1) on_path(path);
    }
    Json transfers = transfers_json(board_.carrier_counters());
    if (!transfers.is_null()) lines_.write(line_of(object("transfers", std::move(transfers))));
  }

 private:
  Json object(const char* type, Json fields) const {
    return {{"type", type},
            {"transport", board_.name()},
            {"pnum", nullptr},
            {"t", nullptr},
            {"fields", std::move(fields)}};
  }
  Json object_of(const char* type, const Datagram& datagram) const {
    Json json = object(type, fields_json(datagram));
    json["pnum"] = datagram.pnum();
    json["t"] = datagram.time_ms();
    return json;
  }
  void print(const char* type, const Datagram& datagram) {
    lines_.write(line_of(object_of(type, datagram)));
  }

  const AsyncBoard& board_;
  LineWriter& lines_;
  bool up_ = true;
};

class PlainView final : public MonitorView {
 public:
  explicit PlainView(LineWriter& lines) : lines_(lines) {}

  void on_state(const ReceivedState&, const Datagram& datagram) override {
    std::string line = fmt::format("state {:>10} T {:>10} ", datagram.pnum(), datagram.time_ms());
    for (const Field& field : datagram) {
      if (field.name() == Text("PNum") || field.name() == Text("T")) continue;
      line += fmt::format(" {}:{}", view(field.name()), view(field.values()));
    }
    line += '\n';
    lines_.write(line);
  }
  void on_reading(const DeviceNews& news) override {
    std::string line = fmt::format("{} T {:>10} ", news.device.text(), news.t_ms);
    for (const DeviceNews::Value& value : news.values) line += " " + value_text(value);
    lines_.write(line + "\n");
  }
  void on_device_trouble(const Problem& problem) override { lines_.write(problem.text() + "\n"); }
  void on_nack(const Nack& nack, const Datagram&) override {
    lines_.write(fmt::format("refused PNum {}: {}\n", nack.pnum, meaning_of(nack.code)));
  }
  void on_bad_datagram(const ReadResult& result, std::string_view bytes) override {
    lines_.write(fmt::format("damaged datagram ({} at byte {}): {}\n", to_text(result.error),
                             result.position, shown(bytes)));
  }
  void on_link(const LinkStatus& status) override {
    lines_.write(fmt::format("link: {}\n", link_text(status)));
  }
  void on_event(const CarrierEvent& event) override {
    if (event.kind == CarrierEvent::Kind::up) {
      lines_.write(fmt::format("{}: up\n", event.problem.thing));
    } else {
      lines_.write(event.problem.text() + "\n");
    }
  }
  void on_path(const PathStatus& path) override {
    lines_.write(fmt::format("path {}: {}\n", path.name, to_text(path.state)));
  }

 private:
  LineWriter& lines_;
};

}  // namespace

std::unique_ptr<MonitorView> make_json_view(const AsyncBoard& board, LineWriter& lines) {
  return std::make_unique<JsonView>(board, lines);
}
std::unique_ptr<MonitorView> make_plain_view(LineWriter& lines) {
  return std::make_unique<PlainView>(lines);
}

std::string value_text(const DeviceNews::Value& value) {
  const std::string number = value.number ? fmt::format("{:.5g}", *value.number) : "-";
  const std::string& unit = value.meaning->unit;
  return fmt::format("{} {}{}{}", value.meaning->name, number, unit.empty() ? "" : " ", unit);
}

std::string link_text(const LinkStatus& status) {
  std::string text;
  switch (status.state) {
    case HostLinkState::connecting:
      text = "CONNECTING";
      break;
    case HostLinkState::active:
      text = "ACTIVE";
      break;
    case HostLinkState::safe:
      text = fmt::format("SAFE ({})", to_text(status.reason));
      break;
    case HostLinkState::lost:
      text = "LOST: the board is silent";
      break;
  }
  if (const std::optional<LinkCause> cause = status.cause()) {
    const Problem problem = explain(*cause);
    text += fmt::format(", {}; {}", problem.reason, problem.fix);
  }
  return text;
}

}  // namespace r4::tool

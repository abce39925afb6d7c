// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge.hpp"

#include <fmt/format.h>
#include <sys/prctl.h>

#include <asio/post.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../boards/board_set.hpp"
#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/output.hpp"
#include "board_node.hpp"
#include "discovery/discovery.hpp"
#include "discovery/mismatches.hpp"
#include "discovery/namesakes.hpp"
#include "domain/environment.hpp"
#include "graph/graph.hpp"
#include "graph/inbox.hpp"
#include "graph/outbox.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::tool::ros2 {
namespace {

// The fields that all topics need. On a CAN bus only the paper's fields fit.
std::string component_fields() {
  std::string fields = "DEFAULT";
  const FieldSet paper = FieldSet::paper_default();
  for (const StateFieldRow& row : state_fields) {
    if (paper.has(row.field)) continue;
    if (row.field > StateField::relays && row.kind != FieldKind::encoder_hz) continue;
    fields.append(",").append(row.name.data(), row.name.size());
  }
  return fields;
}

NodeOptions node_options(const BridgeOptions& options) {
  NodeOptions node;
  node.arm = options.arm;
  node.deadline = options.deadline;
  node.servo = servo_unit(options.servo);
  if (!options.counts_per_turn.empty()) {
    node.counts_per_turn = positive_number("--counts-per-turn", options.counts_per_turn);
  }
  if (!options.steps_per_turn.empty()) {
    node.steps_per_turn = positive_number("--steps-per-turn", options.steps_per_turn);
  }
  if (options.drive.empty()) {
    if (!options.separation.empty() || !options.full_speed.empty()) {
      throw Error(ErrorKind::usage, "--wheel-separation, --full-speed", "need the option --drive",
                  "also name the two motor channels: --drive osmc1,osmc2");
    }
    return node;
  }
  if (options.separation.empty() || options.full_speed.empty()) {
    throw Error(ErrorKind::usage, "--drive " + options.drive,
                "needs the distance between the wheels, and their full speed",
                "add --wheel-separation METRES --full-speed METRES_A_SECOND");
  }
  node.drive =
      differential_drive(options.drive, positive_number("--wheel-separation", options.separation),
                         positive_number("--full-speed", options.full_speed));
  return node;
}

struct NamedUrl {
  std::string url;
  NodeName name;
};

// One board is in the namespace itself. Several boards are below, as board1 …, or pattern numbers.
std::vector<NamedUrl> named_urls(const BridgeOptions& options) {
  const std::vector<PatternUrl> urls = expand_urls(options.urls);
  const bool numbered = options.urls.size() == 1;
  const NodeName base = node_name(options.space, options.name);
  std::vector<NamedUrl> named;
  for (const PatternUrl& each : urls) {
    std::string space = base.space;
    if (urls.size() > 1) {
      std::string number = std::to_string(named.size() + 1);
      if (numbered && !each.number.empty()) number = each.number;
      for (char& c : number) {
        if (c == '-' || c == ',') c = '_';
      }
      space = below(base.space, "board" + number);
    }
    named.push_back({each.url, node_name(space, options.name)});
  }
  return named;
}

Json endpoints_json(const std::vector<Endpoint>& endpoints) {
  Json all = Json::array();
  for (const Endpoint& each : endpoints) all.push_back({{"name", each.name}, {"type", each.type}});
  return all;
}

const char* level_text(LogLevel level) {
  switch (level) {
    case LogLevel::info:
      return "info";
    case LogLevel::warning:
      return "warning";
    default:
      return "error";
  }
}

constexpr std::size_t jobs_a_board = 256;  // most jobs that may wait to be published

class Bridge {
 public:
  explicit Bridge(const BridgeOptions& options)
      : options_(options),
        output_(std::size_t{1} << 20),
        domain_(domain_of(process_environment)),
        urls_(named_urls(options)),
        graph_(domain_),
        outbox_(jobs_a_board * urls_.size()),
        inbox_(boards_.io(), domain_.one_computer ? Transit::Clocks::one : Transit::Clocks::two,
               [this] {
                 for (const auto& node : nodes_) node->flush();
               }) {
    NodeOptions shown = node_options(options);
    shown.one_clock = domain_.one_computer;
    for (const NamedUrl& each : urls_) add(each, shown);
    if (urls_.front().name.space != "/") decline_root();
  }

  int run() {
    boards_.open();
    for (const auto& node : nodes_) node->start();
    introduce();
    discover();
    inbox_.start();
    boards_.end_by_signal(options_.duration);
    boards_.run();
    inbox_.stop();
    boards_.leave();
    outbox_.stop();
    graph_.leave();
    return 0;
  }

 private:
  void add(const NamedUrl& named, NodeOptions shown) {
    BoardOptions board_options = with_key(options_.key);
    const std::string usual = has_path(named.url, "can") ? "DEFAULT" : component_fields();
    shown.devices = Device::from(options_.devices);
    ask_for(board_options, options_.fields.empty() ? usual : options_.fields, shown.devices);
    parse_fields(Text(board_options.session.fields), shown.fields);
    shown.fields.add(StateField::relays);  // needed for arming
    nodes_.push_back(
        std::make_unique<BoardNode>(boards_.io(), boards_.add(named.url, board_options).board,
                                    graph_, graph_.add_node(named.name), inbox_, outbox_, shown,
                                    [this](LogLevel level, const std::string& node,
                                           const std::string& text) { say(level, node, text); }));
  }

  // Users often forget the namespace.
  void decline_root() {
    for (const std::string topic : {"stop", "arm", "R4_Command", "cmd_vel"}) {
      const std::string ours = full_name(urls_.front().name, topic);
      const char* const more = urls_.size() > 1 ? ", and so on for each board" : "";
      graph_.on_other_type(0, "/" + topic, [topic, ours, more](const Announced& writer) {
        return Mismatch{
            Mismatch::Weight::warning,
            fmt::format(
                "/{}: a publisher ({}) uses a topic that r4 ros2 does not receive; publish {}{}",
                topic, writer.owner_text(), ours, more)};
      });
    }
  }

  // The graph is examined on the reading thread.
  void discover() {
    graph_.list_nodes(process_environment("ROS_DISTRO"));
    namesakes_.emplace(graph_.nodes());
    mismatches_.emplace(graph_, [this](std::size_t node, const EntityId& who,
                                       const std::optional<Mismatch>& mismatch) {
      asio::post(boards_.io(),
                 [this, node, who, mismatch] { nodes_[node]->on_mismatch(who, mismatch); });
    });
    discovery_.emplace(graph_.participants(), [this](const Announced& announced) {
      graph_.on_announced(announced);
      mismatches_->on_announced(announced);
      const auto node = namesakes_->node_of(announced);
      if (!node) return;
      asio::post(boards_.io(),
                 [this, node = *node,
                  who = announced.owner.empty() ? "another participant" : announced.owner] {
                   warn_of(node, who);
                 });
    });
    for (const dds_entity_t each : discovery_->entities()) {
      inbox_.watch(each, [this] { discovery_->look(); });
    }
  }

  void warn_of(std::size_t node, const std::string& who) {
    nodes_[node]->warn(fmt::format(
        "{} also has a node {}, so commands reach the boards of both nodes; give one node another "
        "--namespace, or end its program (a killed program disappears after 10 s)",
        who, nodes_[node]->name()));
  }

  void introduce() {
    std::string names;
    Json list = Json::array();
    for (const auto& node : nodes_) {
      names += (names.empty() ? "" : " ") + node->name();
      list.push_back({{"name", node->name()}, {"url", node->board().name()}});
    }
    if (options_.json) {
      output_.write(line_of({{"type", "ready"},
                             {"domain", domain_.id},
                             {"reach", domain_.reach},
                             {"nodes", list},
                             {"publishers", endpoints_json(graph_.publishers())},
                             {"subscriptions", endpoints_json(graph_.subscriptions())},
                             {"services", endpoints_json(graph_.services())}}));
      return;
    }
    output_.write(fmt::format("{} in domain {}, reach: {}\n", names, domain_.id, domain_.reach));
    const auto list_all = [this](const char* title, const std::vector<Endpoint>& endpoints) {
      output_.write(fmt::format("{}\n", title));
      for (const Endpoint& each : endpoints) {
        output_.write(fmt::format("  {}  {}\n", each.name, each.type));
      }
    };
    list_all("publishes", graph_.publishers());
    list_all("takes", graph_.subscriptions());
    list_all("serves", graph_.services());
  }

  void say(LogLevel level, const std::string& node, const std::string& text) {
    if (options_.json) {
      output_.write(
          line_of({{"type", "log"}, {"level", level_text(level)}, {"node", node}, {"text", text}}));
    } else {
      output_.write(fmt::format("{}: {}: {}\n", node, level_text(level), text));
    }
  }

  const BridgeOptions& options_;
  LineWriter output_;
  const Domain domain_;
  const std::vector<NamedUrl> urls_;
  Graph graph_;
  std::optional<Namesakes> namesakes_;
  std::optional<Mismatches> mismatches_;
  std::optional<Discovery> discovery_;
  BoardSet boards_;
  Outbox outbox_;
  Inbox inbox_;
  std::vector<std::unique_ptr<BoardNode>> nodes_;
};

}  // namespace

int run_bridge(const BridgeOptions& options) {
  ::prctl(PR_SET_NAME, "r4 ros2");  // errors of other programs name this program by it
  return Bridge(options).run();
}

}  // namespace r4::tool::ros2

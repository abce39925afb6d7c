// SPDX-License-Identifier: GPL-3.0-or-later
// r4 ros2: boards as nodes of a ROS 2 graph, by Cyclone DDS.
#include <fmt/format.h>

#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/signal_set.hpp>
#include <asio/steady_timer.hpp>
#include <csignal>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/line_writer.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "board_node.hpp"
#include "graph/environment.hpp"
#include "graph/graph.hpp"
#include "graph/inbox.hpp"
#include "graph/outbox.hpp"
#include "protocol/messages/command_field.hpp"
#include "r4link/error.hpp"
#include "transports/url.hpp"
#include "transports/url_pattern.hpp"

namespace r4::tool {
namespace {

// What all the topics need. On a CAN bus the paper's fields: others have to fit beside them.
constexpr const char* component_fields =
    "DEFAULT,AIN6,DHB1B,DHB2A,DHB2B,OSMC2,OSMC3,OSMC4,STEP2POS,STEP3POS,STEP4POS,SERVO2POS,"
    "SERVO3POS,"
    "SERVO4POS,SERVO5POS,SERVO6POS,SERVO7POS,SERVO8POS,SERVO9POS,SERVO10POS,SERVO11POS,SERVO12POS,"
    "SERVO13POS,SERVO14POS,SERVO15POS,SERVO16POS,ENC1,ENC2,ENC3,ENC4,ENC1HZ,ENC2HZ,ENC3HZ,ENC4HZ,"
    "US1,US2,US3,US4,BLDC1,BLDC2,BLDC3,BLDC4,RELAYS";

struct Options {
  std::vector<std::string> urls;
  std::string name = "r4";
  std::string space;
  std::string fields;
  bool arm = false;
  Milliseconds deadline{1000};
  std::string servo;
  std::string drive;
  std::string separation;
  std::string full_speed;
  std::string counts_per_turn;
  std::string steps_per_turn;
  std::optional<Milliseconds> duration;
  std::string key;
  bool json = false;
};

ros2::NodeOptions node_options(const Options& options) {
  ros2::NodeOptions node;
  node.arm = options.arm;
  node.deadline = options.deadline;
  if (!options.servo.empty()) node.servo = ros2::servo_calibration(options.servo);
  if (!options.counts_per_turn.empty()) {
    node.counts_per_turn = ros2::positive_number("--counts-per-turn", options.counts_per_turn);
  }
  if (!options.steps_per_turn.empty()) {
    node.steps_per_turn = ros2::positive_number("--steps-per-turn", options.steps_per_turn);
  }
  if (options.drive.empty()) {
    if (!options.separation.empty() || !options.full_speed.empty()) {
      throw Error(ErrorKind::usage, "--wheel-separation, --full-speed", "say nothing alone",
                  "name the two motor channels, too: --drive osmc1,osmc2");
    }
    return node;
  }
  if (options.separation.empty() || options.full_speed.empty()) {
    throw Error(ErrorKind::usage, "--drive " + options.drive,
                "needs to know how far apart the wheels are, and how fast they can be",
                "add --wheel-separation METRES --full-speed METRES_A_SECOND");
  }
  node.drive = ros2::differential_drive(
      options.drive, ros2::positive_number("--wheel-separation", options.separation),
      ros2::positive_number("--full-speed", options.full_speed));
  return node;
}

struct NamedUrl {
  std::string url;
  ros2::NodeName name;
};

// One board is in the namespace itself, several are each in one below it: board1, board2 …, or the numbers of a
// pattern.
std::vector<NamedUrl> named_urls(const Options& options) {
  std::vector<PatternUrl> urls;
  for (const std::string& pattern : options.urls) {
    for (PatternUrl& each : expand_urls(pattern)) urls.push_back(std::move(each));
  }
  const bool numbered = options.urls.size() == 1;
  const ros2::NodeName base = ros2::node_name(options.space, options.name);
  std::vector<NamedUrl> named;
  for (const PatternUrl& each : urls) {
    std::string space = base.space;
    if (urls.size() > 1) {
      std::string number = std::to_string(named.size() + 1);
      if (numbered && !each.number.empty()) number = each.number;
      for (char& c : number) {
        if (c == '-' || c == ',') c = '_';
      }
      space = ros2::below(base.space, "board" + number);
    }
    named.push_back({each.url, ros2::node_name(space, options.name)});
  }
  return named;
}

Json endpoints_json(const std::vector<ros2::Endpoint>& endpoints) {
  Json all = Json::array();
  for (const ros2::Endpoint& each : endpoints)
    all.push_back({{"name", each.name}, {"type", each.type}});
  return all;
}

const char* level_text(ros2::LogLevel level) {
  switch (level) {
    case ros2::LogLevel::info:
      return "info";
    case ros2::LogLevel::warning:
      return "warning";
    default:
      return "error";
  }
}

class Bridge {
 public:
  explicit Bridge(const Options& options)
      : options_(options),
        output_(std::size_t{1} << 20),
        domain_(ros2::domain_of(ros2::process_environment)),
        graph_(domain_),
        inbox_(io_, graph_.participant(),
               [this] {
                 for (const auto& node : nodes_) node->flush();
               }),
        signals_(io_),
        end_(io_) {
    const ros2::NodeOptions shown = node_options(options);
    for (const NamedUrl& each : named_urls(options)) add(each, shown);
  }

  int run() {
    for (const auto& node : nodes_) node->open();
    ros2::NodeListing& listing = graph_.list_nodes(ros2::process_environment("ROS_DISTRO"));
    inbox_.watch(listing.peers(), [&listing] { listing.look(); });
    ros2::Namesakes& namesakes =
        graph_.watch_names([this](const ros2::NodeName& node, const std::string& who) {
          asio::post(io_, [this, name = node.full(), who] { warn_of(name, who); });
        });
    inbox_.watch(namesakes.writers(), [&namesakes] { namesakes.look(); });
    inbox_.start();
    introduce();
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) signals_.add(number);
    signals_.async_wait([this](const std::error_code&, int) { io_.stop(); });
    if (options_.duration) {
      end_.expires_after(*options_.duration);
      end_.async_wait([this](const std::error_code&) { io_.stop(); });
    }
    io_.run();
    leave();
    return 0;
  }

 private:
  void add(const NamedUrl& named, ros2::NodeOptions shown) {
    BoardOptions board_options = with_key(options_.key);
    const bool bus = Url::parse(named.url).scheme() == "can";
    board_options.session.fields = !options_.fields.empty() ? options_.fields
                                   : bus                    ? "DEFAULT"
                                                            : component_fields;
    parse_fields(Text(board_options.session.fields), shown.fields);
    shown.fields.add(StateField::relays);  // arming asks for it
    nodes_.push_back(std::make_unique<ros2::BoardNode>(
        io_, named.url, board_options, graph_, graph_.add_node(named.name), inbox_, outbox_, shown,
        [this](ros2::LogLevel level, const std::string& node, const std::string& text) {
          say(level, node, text);
        }));
  }

  void warn_of(const std::string& name, const std::string& who) {
    for (const auto& node : nodes_) {
      if (node->name() != name) continue;
      node->warn(fmt::format(
          "{} has a node {}, too: what is commanded reaches the boards of both; give one of them "
          "another --namespace, or end it (who was killed is gone after 10 s)",
          who, name));
    }
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
    const auto list_all = [this](const char* title, const std::vector<ros2::Endpoint>& endpoints) {
      output_.write(fmt::format("{}\n", title));
      for (const ros2::Endpoint& each : endpoints) {
        output_.write(fmt::format("  {}  {}\n", each.name, each.type));
      }
    };
    list_all("publishes", graph_.publishers());
    list_all("takes", graph_.subscriptions());
    list_all("serves", graph_.services());
  }

  void say(ros2::LogLevel level, const std::string& node, const std::string& text) {
    if (options_.json) {
      output_.write(
          line_of({{"type", "log"}, {"level", level_text(level)}, {"node", node}, {"text", text}}));
    } else {
      output_.write(fmt::format("{}: {}: {}\n", node, level_text(level), text));
    }
  }

  // Nobody is told of us any more, no sample is taken or written; then the boards hear that they are free.
  void leave() {
    inbox_.stop();
    outbox_.stop();
    graph_.leave();
    std::size_t left = nodes_.size();
    io_.restart();
    constexpr Milliseconds limit{100};
    for (const auto& node : nodes_) {
      node->board().async_close(limit, [this, &left](const CommandResult&) {
        if (--left == 0) io_.stop();
      });
    }
    io_.run();
  }

  const Options& options_;
  LineWriter output_;
  asio::io_context io_{1};
  const ros2::Domain domain_;
  ros2::Graph graph_;
  ros2::Outbox outbox_;
  ros2::Inbox inbox_;
  std::vector<std::unique_ptr<ros2::BoardNode>> nodes_;
  asio::signal_set signals_;
  asio::steady_timer end_;
};

int ros2_bridge(const Options& options) { return Bridge(options).run(); }

constexpr const char* footer =
    R"(Joins the ROS 2 graph as the node /r4, without ROS being installed: the paper's topics R4, R4_Heart_Beat,
R4_Active and R4_Command (std_msgs/String), a topic for each component, diagnostics, and the services ~/stop,
~/clear, ~/arm and ~/send. docs/ros2.md has each topic with its units, and how to drive a robot by cmd_vel.

Nothing drives before it is armed: by --arm, once, when the board is there; by true on the topic arm; by the
service ~/arm. After a stop or a fault that has to be done again. What a publisher drives is switched off when
it is gone, or silent for --deadline. Of several boards each has a namespace: board1, board2 …, or a pattern's
numbers.

The graph is that of ROS_DOMAIN_ID, on this computer alone unless ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET,
ROS_STATIC_PEERS or CYCLONEDDS_URI say otherwise.

Examples:
  r4 ros2 serial:auto
  ros2 topic pub --once /arm std_msgs/msg/Bool '{data: true}'
  ros2 topic pub --rate 10 /osmc1/command std_msgs/msg/Float32 '{data: 0.1}'
  ros2 topic pub --once /stop std_msgs/msg/Bool '{data: true}'
  r4 ros2 udp://192.168.0.125 --drive osmc1,-osmc2 --wheel-separation 0.4 --full-speed 1.5
  r4 ros2 'can://can0?node=0-3' --namespace robot       /robot/board0/R4 …

Exit codes: 0 ended by --for or Ctrl-C; 2 usage; 4 a transport or the graph cannot be opened; 5 permission
denied.)";

}  // namespace

void add_ros2(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(root, chosen, "ros2", "Boards as nodes of ROS 2", footer,
                                           options, ros2_bridge);
  add_urls(*command, options->urls);
  add_text(*command, "--name", options->name, "the node's name (default r4)", "NAME");
  add_text(*command, "--namespace", options->space, "its namespace (default /)", "NAME");
  add_flag(*command, "--arm", options->arm, "arm as soon as the board is there, once");
  add_seconds(*command, "--deadline", options->deadline,
              "of a publisher that drives (default 1); 0: none", Zero::allowed);
  add_text(*command, "--drive", options->drive, "the two motor channels of cmd_vel, left and right",
           "LEFT,RIGHT");
  add_text(*command, "--wheel-separation", options->separation, "metres between the two wheels",
           "METRES");
  add_text(*command, "--full-speed", options->full_speed, "metres a second of a wheel at full duty",
           "SPEED");
  add_text(*command, "--servo", options->servo,
           "us, or MIN_US,MAX_US,RADIANS (default 500,2500,3.14159)", "SERVO");
  add_text(*command, "--counts-per-turn", options->counts_per_turn,
           "of the encoders, for joint_states", "COUNTS");
  add_text(*command, "--steps-per-turn", options->steps_per_turn,
           "of the steppers, for joint_states", "STEPS");
  add_fields(*command, options->fields, "state fields to ask for: what topics there are");
  add_seconds(*command, "--for", options->duration, "end after that time");
  add_key(*command, options->key);
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool

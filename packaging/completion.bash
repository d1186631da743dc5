# Completion of the programs' options, as their --help lists them, of the names that some take, and of files.
_hybrid_slam() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} help words command=()
  COMPREPLY=()
  [[ $COMP_CWORD -eq 1 || ! ${COMP_WORDS[1]} =~ ^(check|live)$ ]] || command=("${COMP_WORDS[1]}")
  help=$("$1" "${command[@]}" --help 2>/dev/null) || return
  if [[ $current == -* ]]; then
    words=$(grep -oE -- '(^|[ ,])--?[a-z][a-z-]*' <<<"$help" | tr -d ' ,' | sort -u)
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  elif [[ $previous == --* ]]; then
    case $previous in
      --layout) words="auto kitti euroc uwslam 4seasons" ;;
      --mode) words="every-frame realtime" ;;
      --cameras) words="auto stereo hybrid" ;;
      --device) words="auto cpu cuda" ;;
      --loops | --report) words="on off" ;;
      --images) words="raw rectified" ;;
      --view | --port) words="8417" ;;
      --view-address | --address) words="127.0.0.1 0.0.0.0" ;;
      --channel) words="grey red green blue" ;;
      --log-level) words="trace debug info warning error" ;;
      *) words="" ;;
    esac
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  fi
  [[ ${#COMPREPLY[@]} -gt 0 ]] || mapfile -t COMPREPLY < <(compgen -f -- "$current")
}
complete -o filenames -F _hybrid_slam hybrid_slam map_optimizer map_tool trajectory_eval vocabulary_trainer feature_eval \
  scene_renderer

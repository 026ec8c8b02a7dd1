#compdef relief
# Completion of relief in zsh. The program itself knows what may come next.
_relief()
{
  local line kind value rest
  local -a plain parts fields
  local -a suffixes
  for line in "${(@f)$("${(Q)words[1]/#\~/$HOME}" complete -- "${(@Q)words[2,CURRENT]}" 2>/dev/null)}"; do
    fields=("${(@ps:\t:)line}")
    kind=$fields[1]
    value=$fields[2]
    rest=$fields[3]
    case $kind in
      word) plain+=("${value//:/\\:}${rest:+:$rest}") ;;
      part) parts+=("$value") ;;
      file)
        suffixes=("${(@s: :)value}")
        [[ -n $rest ]] && compset -P '*='
        if [[ -n $value ]]; then
          _files -g "*(${(j:|:)suffixes})(-.)"
        else
          _files
        fi
        ;;
    esac
  done
  (( $#plain )) && _describe relief plain
  (( $#parts )) && compadd -S '' -- "${parts[@]}"
}
if [[ $funcstack[1] == _relief ]]; then
  _relief "$@"
else
  compdef _relief relief
fi

# SPDX-License-Identifier: GPL-3.0-or-later
# Complete the last word of each line of standard input at a terminal, and print the words: zsh -f complete.zsh FOLDER
# FOLDER has _supine. Control-X writes the line to a file, and empties it.
zmodload zsh/zpty
export folder=$1 work=$(mktemp -d)
setup() {
  fpath=($folder $fpath)
  autoload -U compinit
  compinit -D -u
  write_line() { print -r -- ${${(z)BUFFER}[-1]} >$work/part; mv $work/part $work/line; BUFFER= }
  zle -N write_line
  bindkey '^I' complete-word '^X' write_line
}
zpty terminal "zsh -f -i"
zpty -w terminal "$(functions setup); setup"
while read -r line; do
  zpty -w -n terminal "$line"$'\t\C-x'
  for (( i = 0; i < 200; ++i )); do
    [ -e $work/line ] && break
    sleep 0.1
  done
  cat $work/line
  rm -f $work/line
done
rm -r $work

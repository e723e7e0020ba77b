% A penalty renderer for the plane that hapticeval asks in JSON lines, for Octave 7 or later:
%   hapticeval run -r 'cmd:octave-cli -qf mine.m'
while true
  try, line = input('', 's'); catch, break, end  % fgetl(stdin) of Octave waits for the line after
  m = jsondecode(line);
  answer = struct('id', m.id);
  switch m.call
    case 'hello'
      answer.version = 1; answer.supports = {'plane'}; answer.spring = true;
    case 'scene'
      a = m.vertices(m.cells(:, 1) + 1, :);  % edges: from a along u
      u = m.vertices(m.cells(:, 2) + 1, :) - a;
      stiffness = m.stiffness;
    case 'step'
      hip = m.hip';
      if ~isnumeric(hip) || any(isnan(hip))  % null: there is no number
        answer.refuse = 'a hand without a position';
      else
        p = hip - a;
        q = p - u;
        turn = sum(atan2(p(:, 1) .* q(:, 2) - p(:, 2) .* q(:, 1), sum(p .* q, 2)));
        answer.ihip = hip;
        if abs(turn) > 3  % 2 pi inside, 0 outside
          share = min(max(sum(p .* u, 2) ./ sum(u .^ 2, 2), 0), 1);
          [~, n] = min(sum((p - share .* u) .^ 2, 2));
          answer.ihip = a(n, :) + share(n) * u(n, :);
        end
        answer.force = stiffness * (answer.ihip - hip);
      end
    case 'bye'
      break
  end
  disp(jsonencode(answer)); fflush(stdout);
end
